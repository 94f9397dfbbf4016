"""The Python kind of FMU: what PythonFMU leaves to a slave, done once, and its packaging.

==================== ===============================================================
module               what it states
==================== ===============================================================
:mod:`.component`    the base of all components: what PythonFMU calls, and their runs
:mod:`.slave`        the slave of a component, made from its definition
:mod:`.state`        the values of an instance, and the state of an FMU: exact and checked
:mod:`.noise`        random numbers, of which those of a refused step are drawn again
:mod:`.loading`      making up for what PythonFMU does to a process, and to a user's script
:mod:`.modules`      the modules that an FMU holds, and their imports under other names
:mod:`.packaging`    an FMU that holds Python sources and has PythonFMU run them, sealed
==================== ===============================================================

`loader` is the library that lets an FMU run where there is no Python.
"""
