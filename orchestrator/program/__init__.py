"""A system as one compiled program: the same numbers as its FMUs, far sooner.

===================  ==============================================================
module               what it holds
===================  ==============================================================
:mod:`.components`   what the authors of its components wrote, found by their FMUs
:mod:`.kind`         a component in C
:mod:`.reducing`     indices that look on
:mod:`.writer`       the text of all of it in C
:mod:`.events`       what happens between steps
:mod:`.noise`        whether noise is added to what is measured, and so may be none
:mod:`.fmu`          the text as one FMU, to a host that knows nothing of components
:mod:`.library`      the text compiled, kept and called
===================  ==============================================================
"""
