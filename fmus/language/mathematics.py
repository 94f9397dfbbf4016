"""Functions of Python's `math` in the language, and the cases in which they raise.

Everything else follows from this table: the functions that may be called, their names in C, the
reserved names, the functions that compilers must not evaluate, their derivatives, and the list on
the page of the language.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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
        slopes: partial derivatives by the arguments x and y, in C, where z is the result; one that
            is missing is 0.

    """

    arguments: int = 1
    raises: str = ""
    result: Scalar = FLOAT
    is_rounded: bool = True
    factor: float = 0.0
    slopes: Sequence[str] = ()


FUNCTIONS: Mapping[str, Function] = {
    "acos": Function(raises="x < -1.0 || x > 1.0", slopes=("-1.0 / sqrt((1.0 - x) * (1.0 + x))",)),
    "acosh": Function(raises="x < 1.0", slopes=("1.0 / (sqrt(x - 1.0) * sqrt(x + 1.0))",)),
    "asin": Function(raises="x < -1.0 || x > 1.0", slopes=("1.0 / sqrt((1.0 - x) * (1.0 + x))",)),
    "asinh": Function(slopes=("1.0 / hypot(1.0, x)",)),
    "atan": Function(slopes=("1.0 / (1.0 + x * x)",)),
    "atan2": Function(2, slopes=("y / (x * x + y * y)", "-x / (x * x + y * y)")),
    "atanh": Function(raises="x <= -1.0 || x >= 1.0", slopes=("1.0 / ((1.0 - x) * (1.0 + x))",)),
    "ceil": Function(result=INT, is_rounded=False),
    "copysign": Function(2, is_rounded=False, slopes=("copysign(1.0, x) * copysign(1.0, y)",)),
    "cos": Function(raises="isinf(x)", slopes=("-sin(x)",)),
    "cosh": Function(raises=RANGE, slopes=("sinh(x)",)),
    "degrees": Function(factor=math.degrees(1.0)),
    "exp": Function(raises=RANGE, slopes=("z",)),
    "expm1": Function(raises=RANGE, slopes=("exp(x)",)),
    "fabs": Function(is_rounded=False, slopes=("copysign(1.0, x)",)),
    "floor": Function(result=INT, is_rounded=False),
    "fmod": Function(2, raises=OWN, is_rounded=False, slopes=("1.0", "-trunc(x / y)")),
    "isfinite": Function(result=BOOL, is_rounded=False),
    "isinf": Function(result=BOOL, is_rounded=False),
    "isnan": Function(result=BOOL, is_rounded=False),
    "log": Function(raises="x <= 0.0", slopes=("1.0 / x",)),
    "log10": Function(raises="x <= 0.0", slopes=("0.4342944819032518 / x",)),
    "log1p": Function(raises="x <= -1.0", slopes=("1.0 / (1.0 + x)",)),
    "log2": Function(raises="x <= 0.0", slopes=("1.4426950408889634 / x",)),
    "pow": Function(
        2,
        raises=OWN,
        slopes=("y == 0.0 ? 0.0 : y * pow(x, y - 1.0)", "x == 0.0 ? 0.0 : z * log(x)"),
    ),
    "radians": Function(factor=math.radians(1.0)),
    "sin": Function(raises="isinf(x)", slopes=("cos(x)",)),
    "sinh": Function(raises=RANGE, slopes=("cosh(x)",)),
    "sqrt": Function(raises="x < 0.0", is_rounded=False, slopes=("0.5 / z",)),
    "tan": Function(raises="isinf(x)", slopes=("1.0 + z * z",)),
    "tanh": Function(slopes=("1.0 / (cosh(x) * cosh(x))",)),
    "trunc": Function(result=INT, is_rounded=False),
}

#: Constants of `math`.
CONSTANTS = frozenset(("e", "inf", "nan", "pi", "tau"))

#: Names of the functions by Python's function objects.
BY_FUNCTION = {getattr(math, name): name for name in FUNCTIONS}
