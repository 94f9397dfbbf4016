"""The REMUS 100, a vehicle with fins and one propeller. It is not in the paper.

==================  =========================================================
module              what it states
==================  =========================================================
:mod:`.remus100`    its motion in six degrees of freedom, in water that moves
:mod:`.hull`        mass and added mass, drag and lift, righting moment
:mod:`.tail`        rudder, stern planes, propeller, and their forces
:mod:`.allocation`  fins and propeller from a force and two moments
==================  =========================================================
"""
