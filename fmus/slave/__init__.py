"""The Python kind of component: what PythonFMU leaves to a slave, done once.

==================== ===============================================================
module               what it states
==================== ===============================================================
:mod:`.component`    the base of all components: what one implements, and its steps
:mod:`.callbacks`    values, faults and messages, as PythonFMU passes them
:mod:`.store`        the values of one instance, by value reference
:mod:`.state`        the state of an FMU, complete, exact and checked
:mod:`.shape`        the shape of a component's own state, as its type says it
:mod:`.loading`      making up for what PythonFMU does to a process
:mod:`.scripts`      mistakes in a user's script: told with their line, kept from PythonFMU
==================== ===============================================================
"""
