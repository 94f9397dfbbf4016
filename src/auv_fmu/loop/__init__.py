"""Fig. 2 of the paper as one straight line of Python, with what may stand in it instead.

===================  ==========================================================
module               what it states
===================  ==========================================================
:mod:`.blocks`       which controllers, planners, vehicles and waters there are
:mod:`.closed_loop`  the line, from instant to instant
===================  ==========================================================

Paths, the REMUS 100 and water that moves are not in the paper, and are off by default.
"""
