"""The language of equations: the part of Python that every kind of FMU can run, as typed trees.

==================== ===================================================================
module               what it states
==================== ===================================================================
:mod:`.types`        types: numbers, arrays and records of them
:mod:`.mathematics`  functions of `math`, and when they raise
:mod:`.tree`         what programs consist of
:mod:`.arrays`       the operators of vectors and matrices
:mod:`.words`        what readers call the parts of a program, and what to write instead
:mod:`.build`        the language: functions of Python as trees, and what is none
==================== ===================================================================

`docs/explanation/language.md` describes it for readers.
"""
