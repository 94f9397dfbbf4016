"""Fig. 2 of the paper, as tests and benchmarks need it.

===================  ===========================================
module               what it states
===================  ===========================================
:mod:`.closed_loop`  the line in Python, from instant to instant
===================  ===========================================
"""
