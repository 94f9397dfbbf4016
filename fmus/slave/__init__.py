"""The Python kind of component: what PythonFMU leaves to a slave, done once.

=================== ===============================================================
module              what it states
=================== ===============================================================
:mod:`.component`   the hardened slave that every component extends
:mod:`.loading`     making up for what PythonFMU does to a process
=================== ===============================================================
"""
