"""A system as one compiled program: the same numbers as its FMUs, far sooner.

===================  ==============================================================
module               what it holds
===================  ==============================================================
:mod:`.components`   what the authors of its components wrote, found by their FMUs
:mod:`.writer`       the text in C
:mod:`.library`      the text compiled, kept and called
===================  ==============================================================
"""
