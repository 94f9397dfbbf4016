"""The C kind of component: the same equations, as trees, in C, and the same ports, as tables.

==================== ===================================================================
module               what it states
==================== ===================================================================
:mod:`.names`        what things are called in C
:mod:`.emit`         trees in C
:mod:`.translator`   all equations of a component in C, and how the runtime calls them
:mod:`.tables`       the ports of a component in C
:mod:`.packaging`    an FMU that holds libraries, and their sources
==================== ===================================================================

`runtime` holds what all components share: the functions of FMI and their implementation.
"""
