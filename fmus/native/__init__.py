"""The C kind of component: the same equations, translated from trees to C, with tables of ports.

==================== ===================================================================
module               content
==================== ===================================================================
:mod:`.names`        names in C
:mod:`.emit`         trees in C
:mod:`.pieces`       pieces of C that are written around translated equations
:mod:`.translator`   the equations of a component in C, and the functions for the runtime
:mod:`.reducer`      indices in C
:mod:`.tables`       the ports of a component in C
:mod:`.packaging`    FMUs with libraries and their sources
==================== ===================================================================

`runtime` contains the C code that all components share: the functions of FMI.
"""
