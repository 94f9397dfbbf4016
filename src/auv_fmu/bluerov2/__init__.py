"""The BlueROV2 Heavy, a vehicle with eight thrusters. Not in the paper.

=============================  ==========================================================
module                         contents
=============================  ==========================================================
:mod:`.thrusters`              thrust of a command and its inverse, positions, forces
:mod:`.bluerov2`               motion in six degrees of freedom, in moving water
:mod:`.thruster_allocation`    eight commands from a force and a moment
=============================  ==========================================================
"""
