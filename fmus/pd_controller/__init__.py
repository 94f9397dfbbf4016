"""The baseline that measures the velocity.

============== ==============================================================
module         what it states
============== ==============================================================
:mod:`.ports`  its ports, and what its parameters mean to the equations
:mod:`.slave`  how the equations run in it
============== ==============================================================
"""
