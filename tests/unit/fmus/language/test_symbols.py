"""Programs with symbols of CasADi: values and derivatives, and what needs a number."""

from __future__ import annotations

import math
from inspect import getsourcelines
from math import cos, exp, floor, log, sin, sqrt

import pytest

from auv_fmu import Refusal, Vector
from fmus.language.build import Program
from fmus.language.symbols import Evaluator, NotSymbolic

TABLE = (0.5, -1.0, 4.0, 2.5)


def sinc(x: float) -> float:
    """Divides by zero in the branch that is not taken."""
    if x == 0.0:
        return 1.0
    return sin(x) / x


def root(x: float) -> float:
    """Has an infinite derivative in the branch that is not taken."""
    return sqrt(x) if x > 0.0 else 0.25 * x


def nested(x: float) -> float:
    """Returns early in nested branches, and changes a variable after them."""
    y = 2.0 * x
    if x > -1.0:
        if x > 1.0:
            return log(x)
        y = y + exp(x)
    elif x < -2.0:
        return 1.0 / (x + 1.0)
    return y * y


def spared(x: float) -> float:
    """Ends turns and a loop early."""
    found = 0.0
    for k in range(6):
        if k % 2 == 0:
            continue
        if k * x > 4.0:
            break
        if x < 0.0:
            found -= x
            continue
        found += k * x * x
    return found


def halved(x: float) -> float:
    """Repeats something while its argument says so."""
    k = 0
    while x > 1.0 and k < 9:
        x = 0.5 * x
        k += 1
    return x * x + k


def looked_up(x: float) -> float:
    """Takes an element at an index that is computed."""
    k = floor(x)
    return TABLE[k] * x + Vector((x, 2.0 * x, x * x))[k % 3] * k**2


def wrapped(x: float) -> float:
    """Takes remainders and wholes of numbers with signs."""
    return x % 1.5 + x % -0.7 + (x // 0.3) * x + math.trunc(x) * x + round(x) * x


def valid(x: float) -> float:
    """Refuses some arguments."""
    if x < -9.0:
        raise Refusal(f"{x:g} is too small")
    return sqrt(x + 9.0) * min(x, 2.0, cos(x)) + max(abs(x), 1.0)


#: Functions, points, and points in whose neighbourhood they are smooth.
CASES = (
    (sinc, (0.0, 0.5, -2.0), (0.5, -2.0)),
    (root, (-1.0, 0.0, 4.0), (-1.0, 4.0)),
    (nested, (-3.0, -2.0, -1.5, -1.0, 0.5, 1.0, 2.0), (-3.0, -1.5, 0.5, 2.0)),
    (spared, (-2.0, 0.0, 0.5, 1.0, 1.5, 5.0), (-2.0, 0.5, 1.0, 1.5, 5.0)),
    (halved, (-1.0, 1.0, 1.5, 9.0, 1e6), (-1.0, 1.5, 9.0)),
    (looked_up, (0.0, 1.5, 2.0, 3.75), (1.5, 3.75)),
    (wrapped, (-2.5, -0.5, 0.0, 0.5, 1.5, 2.2), (-2.2, 0.4, 2.2)),
    (valid, (-9.0, -1.0, 0.5, 2.0, 3.0), (-1.0, 0.5, 3.0)),
)


def function_of(equation):
    ca = pytest.importorskip("casadi")
    x = ca.SX.sym("x")
    program = Program(equation)
    program.check()
    y = Evaluator().call(program.function(equation), x)
    return ca.Function("f", [x], [y, ca.jacobian(y, x), ca.jtimes(y, x, ca.SX(1), True)])


@pytest.mark.parametrize(("equation", "points", "smooth"), CASES, ids=lambda case: str(case)[:20])
def test_values_and_derivatives_agree_with_the_program(equation, points, smooth):
    function = function_of(equation)
    for x in points:
        value, *derivatives = map(float, function(x))
        assert value == pytest.approx(equation(x), rel=1e-14, abs=1e-15), x
        assert all(map(math.isfinite, derivatives)), x
    for x in smooth:
        d = 1e-6
        slope = (equation(x + d) - equation(x - d)) / (2.0 * d)
        _, *derivatives = map(float, function(x))
        assert derivatives == pytest.approx([slope, slope], rel=1e-7, abs=1e-8), x


def endless(x: float) -> float:
    while x != 1.0:
        x = 0.5 * x
    return x


def counted(x: float) -> float:
    y = 0.0
    for k in range(int(x)):
        y += k
    return y


def refused(x: float) -> float:
    y = 0.0
    if y == 0.0:
        raise Refusal(f"{x:g} and {y:g} are refused")
    return x


@pytest.mark.parametrize(
    ("equation", "line", "why"),
    [
        (endless, 1, "the end of a while depends on a symbol"),
        (counted, 2, "the number of turns of a loop depends on a symbol"),
        (refused, 3, "... and 0 are refused"),
    ],
)
def test_what_needs_a_number_is_refused_at_its_line(equation, line, why):
    pytest.importorskip("casadi")
    with pytest.raises(NotSymbolic) as error:
        function_of(equation)
    assert str(error.value) == f"{__file__}:{getsourcelines(equation)[1] + line}: {why}"
