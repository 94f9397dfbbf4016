"""Fig. 2 of the paper, for tests and benchmarks.

===================  ===========================================
module               contents
===================  ===========================================
:mod:`.closed_loop`  the loop as straight-line Python
===================  ===========================================
"""
