"""The C kind of component: the same equations, translated, the same ports, as tables.

==================== ===================================================================
module               what it states
==================== ===================================================================
:mod:`.language`     the subset of Python that equations keep to
:mod:`.shapes`       what types are in C
:mod:`.program`      what a set of functions needs in C: structures, constants, functions
:mod:`.expressions`  names, constants, elements and tuples in C
:mod:`.operators`    operators, comparisons and conditions
:mod:`.calls`        calls: mathematics, classes, methods and functions
:mod:`.arrays`       operations of vectors and matrices
:mod:`.loops`        what a `for` runs over
:mod:`.variables`    which names a piece of a program gives a value
:mod:`.functions`    whole functions: their statements
:mod:`.layout`       lines and comments of C
:mod:`.flat`         inputs, outputs and states as arrays of doubles
:mod:`.tables`       the ports of a component in C
:mod:`.translator`   all equations of a component in C
:mod:`.stack`        how much of a thread's stack a translation takes
:mod:`.packaging`    an FMU that holds libraries, and their sources
==================== ===================================================================

`runtime` holds what all components share: the functions of FMI and their implementation.
"""
