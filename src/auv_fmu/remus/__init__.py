"""The REMUS 100, a vehicle with fins and one propeller. Not in the paper.

==================  ==============================================================
module              contents
==================  ==============================================================
:mod:`.remus100`    motion in six degrees of freedom, in moving water
:mod:`.hull`        mass and added mass, drag and lift, weight and buoyancy
:mod:`.prestero`    the hull in another form: coefficients of products of velocities
:mod:`.tail`        rudder, stern planes, propeller, and their forces
:mod:`.allocation`  fins and propeller from a force and two moments
==================  ==============================================================
"""
