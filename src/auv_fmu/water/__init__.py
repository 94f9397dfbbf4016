"""Moving water: waves and currents. Not in the paper, which has (56) instead.

=====================  ===================================================
module                 contents
=====================  ===================================================
:mod:`.waves`          a random sea, by linear theory
:mod:`.ocean_current`  a mean with a profile over depth, and a random part
:mod:`.sea`            both, at a vehicle
=====================  ===================================================
"""
