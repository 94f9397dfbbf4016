"""The C kind of component: the same equations, translated, the same ports, as tables.

==================== ===============================================================
module               what it states
==================== ===============================================================
:mod:`.language`     the subset of Python that equations keep to
:mod:`.program`      what a set of functions needs in C, and the shapes of its types
:mod:`.expressions`  expressions of the equations in C
:mod:`.functions`    functions of the equations in C, one by one, as lines
:mod:`.translator`   all equations of a component, and its ports, in C
:mod:`.packaging`    an FMU that holds libraries, and their sources
==================== ===============================================================

`runtime` holds what all components share: the functions of FMI and their implementation.
"""
