"""Water that moves: waves and currents. They are not in the paper, which has (56) instead.

=====================  ===================================================
module                 what it states
=====================  ===================================================
:mod:`.waves`          a random sea, by linear theory
:mod:`.ocean_current`  a mean with a profile over depth, and a random part
:mod:`.sea`            both, at a vehicle
=====================  ===================================================
"""
