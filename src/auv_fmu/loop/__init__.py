"""Fig. 2 of the paper: all of it as one straight line of Python.

===================  ==========================================================
module               what it states
===================  ==========================================================
:mod:`.blocks`       which controllers, planners, vehicles and waters there are
:mod:`.closed_loop`  the line, from instant to instant
===================  ==========================================================
"""
