"""Saturation functions: Definition 2, the subject of Lemma 1 and Theorem 2.

Each function returns its value and its derivative together, because Remark 3 needs both.
"""

from __future__ import annotations

from math import exp, hypot, log, log1p, tanh
from typing import Callable

#: xi -> (s(xi), s'(xi))
Saturation = Callable[[float], "tuple[float, float]"]


def hyperbolic_tangent(xi: float) -> tuple[float, float]:
    """s(xi) = tanh(xi), s'(xi) = sech^2(xi): M = 1, s'_M = 1."""
    s = tanh(xi)
    return s, 1.0 - s * s


def algebraic(xi: float) -> tuple[float, float]:
    """s(xi) = xi / sqrt(1 + xi^2), s'(xi) = (1 + xi^2)^(-3/2): M = 1, s'_M = 1."""
    root = hypot(1.0, xi)
    return xi / root, 1.0 / (root * root * root)


def log_cosh(xi: float) -> float:
    """Integral of tanh from 0 to xi: ln(cosh(xi)), without overflow."""
    return abs(xi) + log1p(exp(-2.0 * abs(xi))) - log(2.0)


def algebraic_integral(xi: float) -> float:
    """Integral of xi / sqrt(1 + xi^2) from 0 to xi: sqrt(1 + xi^2) - 1."""
    return hypot(1.0, xi) - 1.0


#: xi -> integral of s from 0 to xi, items (i) and (ii) of Lemma 1
Integral = Callable[[float], float]

#: The saturation functions named in the paper, by the names users select them with.
SATURATIONS: dict[str, Saturation] = {"tanh": hyperbolic_tangent, "algebraic": algebraic}

#: Largest slope s'_M of Lemma 1 of each.
MAXIMUM_SLOPE: dict[str, float] = {"tanh": 1.0, "algebraic": 1.0}

#: Integrals of each, as the Lyapunov functions (34) and (55) need them.
INTEGRALS: dict[str, Integral] = {"tanh": log_cosh, "algebraic": algebraic_integral}
