"""The language of equations: the part of Python that every kind of FMU can run, as typed trees.

==================== ===================================================================
module               content
==================== ===================================================================
:mod:`.types`        types: numbers, and arrays and records of them
:mod:`.mathematics`  functions of `math`, and the cases in which they raise
:mod:`.tree`         statements and expressions of programs
:mod:`.arrays`       operators of vectors and matrices
:mod:`.words`        names of Python's constructs, and advice on replacing some
:mod:`.build`        translation of Python functions to trees, which defines the language
:mod:`.symbols`      evaluation of trees with symbols of CasADi in place of numbers
==================== ===================================================================

`docs/explanation/language.md` describes the language for users.
"""
