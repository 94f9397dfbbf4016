"""A system as one compiled program: the same numbers as its FMUs, at many times the speed.

===================  ===============================================================
module               content
===================  ===============================================================
:mod:`.components`   definitions of a system's components, found by their FMUs
:mod:`.kind`         a component in C
:mod:`.writer`       a system in C, with its indices and events
:mod:`.files`        C files for other programs, such as firmware
:mod:`.fmu`          one FMU of the whole system
:mod:`.library`      compilation, cache and calls
:mod:`.functions`    functions of CasADi
===================  ===============================================================
"""
