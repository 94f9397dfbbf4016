"""Functions of Python's `math` in the language, and the cases in which they raise.

Everything else follows from this table: the functions that may be called, their names in C, the
reserved names, the functions that compilers must not evaluate, and the list on the page of the
language.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from fmus.language.types import BOOL, FLOAT, INT, Scalar

#: An error if the result is infinite and the argument is not.
RANGE = "range"

#: Errors that arithmetic.h implements.
OWN = "own"


class Function(NamedTuple):
    """A function of floats with the same name and the same results in Python and C.

    Attributes:
        arguments: number of arguments.
        raises: RANGE, OWN, or a condition in C for a domain error; empty if it never raises.
        result: type of the result; for an int, the float of C is converted.
        is_rounded: True if the last bit depends on the library, so that a compiler must not
            evaluate it.
        factor: the function is a product with this factor; 0 for other functions.

    """

    arguments: int = 1
    raises: str = ""
    result: Scalar = FLOAT
    is_rounded: bool = True
    factor: float = 0.0


FUNCTIONS: Mapping[str, Function] = {
    "acos": Function(raises="x < -1.0 || x > 1.0"),
    "acosh": Function(raises="x < 1.0"),
    "asin": Function(raises="x < -1.0 || x > 1.0"),
    "asinh": Function(),
    "atan": Function(),
    "atan2": Function(2),
    "atanh": Function(raises="x <= -1.0 || x >= 1.0"),
    "ceil": Function(result=INT, is_rounded=False),
    "copysign": Function(2, is_rounded=False),
    "cos": Function(raises="isinf(x)"),
    "cosh": Function(raises=RANGE),
    "degrees": Function(factor=math.degrees(1.0)),
    "exp": Function(raises=RANGE),
    "expm1": Function(raises=RANGE),
    "fabs": Function(is_rounded=False),
    "floor": Function(result=INT, is_rounded=False),
    "fmod": Function(2, raises=OWN, is_rounded=False),
    "isfinite": Function(result=BOOL, is_rounded=False),
    "isinf": Function(result=BOOL, is_rounded=False),
    "isnan": Function(result=BOOL, is_rounded=False),
    "log": Function(raises="x <= 0.0"),
    "log10": Function(raises="x <= 0.0"),
    "log1p": Function(raises="x <= -1.0"),
    "log2": Function(raises="x <= 0.0"),
    "pow": Function(2, raises=OWN),
    "radians": Function(factor=math.radians(1.0)),
    "sin": Function(raises="isinf(x)"),
    "sinh": Function(raises=RANGE),
    "sqrt": Function(raises="x < 0.0", is_rounded=False),
    "tan": Function(raises="isinf(x)"),
    "tanh": Function(),
    "trunc": Function(result=INT, is_rounded=False),
}

#: Constants of `math`.
CONSTANTS = frozenset(("e", "inf", "nan", "pi", "tau"))

#: Names of the functions by Python's function objects.
BY_FUNCTION = {getattr(math, name): name for name in FUNCTIONS}
