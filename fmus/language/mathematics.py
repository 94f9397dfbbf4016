"""Functions of Python's `math` in the language, and when they raise.

All else follows from this table: what may be called, what is called in C, which names C has taken,
what compilers must not compute, and the list on the page of the language.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from fmus.language.types import BOOL, FLOAT, INT, Scalar

#: Raised where the result is infinite and the argument is not.
RANGE = "range"

#: Raised as arithmetic.h says.
OWN = "own"


class Function(NamedTuple):
    """A function of floats that Python and C compute alike; it has one name in both.

    Attributes:
        arguments: how many it takes.
        raises: where Python raises: RANGE, OWN, or where a condition of C holds, a domain error;
            empty: nowhere.
        result: its type; an int is the float that C gives, as an int.
        is_rounded: whether the last bit is the library's, so that a compiler must not compute it.
        factor: what a product with replaces it; 0: nothing.

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

#: Its constants.
CONSTANTS = frozenset(("e", "inf", "nan", "pi", "tau"))

#: The functions, by themselves.
BY_FUNCTION = {getattr(math, name): name for name in FUNCTIONS}
