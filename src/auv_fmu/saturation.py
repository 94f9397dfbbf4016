"""Saturation functions: Definition 2, the subject of Lemma 1 and Theorem 2.

As in section 2.1 and above Theorem 2 they act on vectors, component by component. Each returns
its value and its slope together, because Remark 3 needs both.
"""

from __future__ import annotations

from math import exp, hypot, log, log1p, tanh
from typing import Callable

from auv_fmu.types import Vector3

#: xi -> (s(xi), diagonal of S'(xi))
Saturation = Callable[[Vector3], tuple[Vector3, Vector3]]


def hyperbolic_tangent(xi: Vector3) -> tuple[Vector3, Vector3]:
    """Tanh(xi) and the diagonal of Sech^2(xi): M = 1, s'_M = 1."""
    s_1, s_2, s_3 = tanh(xi[0]), tanh(xi[1]), tanh(xi[2])
    return (s_1, s_2, s_3), (1.0 - s_1 * s_1, 1.0 - s_2 * s_2, 1.0 - s_3 * s_3)


def algebraic(xi: Vector3) -> tuple[Vector3, Vector3]:
    """xi_i / sqrt(1 + xi_i^2) and its slopes (1 + xi_i^2)^(-3/2): M = 1, s'_M = 1."""
    root_1, root_2, root_3 = hypot(1.0, xi[0]), hypot(1.0, xi[1]), hypot(1.0, xi[2])
    return (
        (xi[0] / root_1, xi[1] / root_2, xi[2] / root_3),
        (
            1.0 / (root_1 * root_1 * root_1),
            1.0 / (root_2 * root_2 * root_2),
            1.0 / (root_3 * root_3 * root_3),
        ),
    )


def log_cosh(xi: float) -> float:
    """Integral of tanh from 0 to xi: ln(cosh(xi)), without overflow."""
    return abs(xi) + log1p(exp(-2.0 * abs(xi))) - log(2.0)


def algebraic_integral(xi: float) -> float:
    """Integral of xi / sqrt(1 + xi^2) from 0 to xi: sqrt(1 + xi^2) - 1."""
    return hypot(1.0, xi) - 1.0


#: xi_i -> integral of s_i from 0 to xi_i, items (i) and (ii) of Lemma 1
Integral = Callable[[float], float]

#: The saturation functions named in the paper, by the names users select them with.
SATURATIONS: dict[str, Saturation] = {"tanh": hyperbolic_tangent, "algebraic": algebraic}

#: Largest slope s'_M of Lemma 1 of each.
MAXIMUM_SLOPE: dict[str, float] = {"tanh": 1.0, "algebraic": 1.0}

#: Integrals of each, as the Lyapunov functions (34) and (55) need them.
INTEGRALS: dict[str, Integral] = {"tanh": log_cosh, "algebraic": algebraic_integral}
