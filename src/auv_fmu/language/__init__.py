"""What equations are written with: what a port is declared by, vectors, random numbers.

======================  ===============================================================
module                  what it states
======================  ===============================================================
:mod:`.variable`        what a field of a class says of a port, and refusals
:mod:`.quantities`      members and units of groups of ports
:mod:`.vectors`         names for tuples of numbers; sums and products of three-vectors
:mod:`.arrays`          Vector and Matrix, with operators
:mod:`.linear_algebra`  linear equations, interpolation
:mod:`.random_numbers`  generators, and the streams that there are
======================  ===============================================================
"""
