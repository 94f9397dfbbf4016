"""The Python kind of FMU: what PythonFMU leaves to a slave, done once, and its packaging.

==================== ===============================================================
module               what it states
==================== ===============================================================
:mod:`.component`    the base of all components: what one implements, and its steps
:mod:`.slave`        the slave of a component, made from its ports and its behaviour
:mod:`.callbacks`    values, faults and messages, as PythonFMU passes them
:mod:`.store`        the values of one instance, by value reference
:mod:`.state`        the state of an FMU, complete, exact and checked
:mod:`.shape`        the shape of a component's own state, as its type says it
:mod:`.loading`      making up for what PythonFMU does to a process
:mod:`.scripts`      mistakes in a user's script: told with their line, kept from PythonFMU
:mod:`.packaging`    an FMU that holds Python sources and has PythonFMU run them
:mod:`.sealing`      reproducible archives that are alone in their process
:mod:`.own`          the FMU of a script of the user's own
:mod:`.loader`       the library that lets an FMU run where there is no Python
==================== ===============================================================
"""
