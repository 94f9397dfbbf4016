"""Sensors of a vehicle, and the filter that fuses them. Not in the paper.

==========================  =======================================================
module                      contents
==========================  =======================================================
:mod:`.sampling`            samples: when they are taken, how late they come, errors
:mod:`.rotations`           quaternions and rotation vectors
:mod:`.sensors`             depth, attitude, velocity, inertial and position sensors
:mod:`.navigation_filter`   an error-state Kalman filter of their samples
==========================  =======================================================
"""
