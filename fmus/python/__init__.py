"""The Python kind of FMU: the base class of slaves of PythonFMU, and the packaging.

==================== ===============================================================
module               content
==================== ===============================================================
:mod:`.component`    the base class of all components: callbacks of PythonFMU, and runs
:mod:`.slave`        the slave of a component, made from its definition
:mod:`.state`        values of an instance, and the state of an FMU: exact and checked
:mod:`.noise`        random numbers, which a refused step gives back
:mod:`.loading`      repairs of PythonFMU's effects on a process and on user scripts
:mod:`.modules`      the modules in an FMU, and their imports under other names
:mod:`.packaging`    FMUs of Python sources that PythonFMU runs, with unique module names
==================== ===============================================================

`loader` is the library that lets an FMU run in hosts that are not Python programs.
"""
