"""Fig. 2 of the paper as one straight line of Python.

===================  ====================================
module               what it states
===================  ====================================
:mod:`.closed_loop`  the line, from instant to instant
===================  ====================================
"""
