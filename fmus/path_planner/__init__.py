"""A reference trajectory through waypoints.

============== ================== ==============================================================
module             what it states
================== ==============================================================
:mod:`.ports`      its ports, and what its parameters mean to the equations
:mod:`.behaviour`  how the equations run in it, in either kind of FMU
:mod:`.slave`      the Python kind
================== ==============================================================
"""
