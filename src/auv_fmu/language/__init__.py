"""Elements of equations: declarations of ports, vectors, random numbers.

======================  ===============================================================
module                  contents
======================  ===============================================================
:mod:`.variable`        declarations of ports at the fields of a class; refusals
:mod:`.quantities`      members and units of groups of ports
:mod:`.vectors`         names for tuples of numbers; sums and products of three-vectors
:mod:`.arrays`          Vector and Matrix, with operators
:mod:`.linear_algebra`  linear equations, interpolation
:mod:`.random_numbers`  generators and their streams
======================  ===============================================================
"""
