"""Saturation functions: Definition 2, the subject of Lemma 1 and Theorem 2.

As in section 2.1 and above Theorem 2 they act on vectors, component by component. Each returns
its value and its slope together, because Remark 3 needs both.
"""

from __future__ import annotations

from math import atan, exp, log, log1p, pi, sqrt, tanh

from auv_fmu.types import Vector3

#: A saturation function as a value: which one of this module it is.
Saturation = int

#: Those named in the paper.
TANH: Saturation = 0
ALGEBRAIC: Saturation = 1

#: One more, whose slope is another: Theorem 2 weighs K_1 with it.
ARCTAN: Saturation = 2

#: All by the names users select them with.
SATURATIONS: dict[str, Saturation] = {"tanh": TANH, "algebraic": ALGEBRAIC, "arctan": ARCTAN}

#: Scales the arc tangent to the bound M = 1; its slope at 0.
_SCALE = 2.0 / pi

#: Largest slope s'_M of Lemma 1 of each.
MAXIMUM_SLOPE: dict[str, float] = {"tanh": 1.0, "algebraic": 1.0, "arctan": _SCALE}

#: From here on 1 + xi^2 is xi^2 but for rounding, and not much later too large for a float.
_LARGE = 1e9


def saturation(s: Saturation, xi: Vector3) -> tuple[Vector3, Vector3]:
    """s(xi) and the diagonal of S'(xi), for the saturation function s."""
    if s == TANH:
        return hyperbolic_tangent(xi)
    if s == ALGEBRAIC:
        return algebraic(xi)
    return arc_tangent(xi)


def hyperbolic_tangent(xi: Vector3) -> tuple[Vector3, Vector3]:
    """Tanh(xi) and the diagonal of Sech^2(xi): M = 1, s'_M = 1."""
    s_1, s_2, s_3 = tanh(xi[0]), tanh(xi[1]), tanh(xi[2])
    return (s_1, s_2, s_3), (1.0 - s_1 * s_1, 1.0 - s_2 * s_2, 1.0 - s_3 * s_3)


def algebraic(xi: Vector3) -> tuple[Vector3, Vector3]:
    """xi_i / sqrt(1 + xi_i^2) and its slopes (1 + xi_i^2)^(-3/2): M = 1, s'_M = 1."""
    root_1, root_2, root_3 = root(xi[0]), root(xi[1]), root(xi[2])
    return (
        (xi[0] / root_1, xi[1] / root_2, xi[2] / root_3),
        (
            1.0 / (root_1 * root_1 * root_1),
            1.0 / (root_2 * root_2 * root_2),
            1.0 / (root_3 * root_3 * root_3),
        ),
    )


def arc_tangent(xi: Vector3) -> tuple[Vector3, Vector3]:
    """(2 / pi) atan(xi_i) and its slopes (2 / pi) / (1 + xi_i^2): M = 1, s'_M = 2 / pi."""
    xi_1, xi_2, xi_3 = xi
    return (
        (_SCALE * atan(xi_1), _SCALE * atan(xi_2), _SCALE * atan(xi_3)),
        (
            _SCALE / (1.0 + xi_1 * xi_1),
            _SCALE / (1.0 + xi_2 * xi_2),
            _SCALE / (1.0 + xi_3 * xi_3),
        ),
    )


def root(xi: float) -> float:
    """sqrt(1 + xi^2), without overflow."""
    return sqrt(1.0 + xi * xi) if abs(xi) < _LARGE else abs(xi)


def integral(s: Saturation, xi: float) -> float:
    """Integral of s_i from 0 to xi, items (i) and (ii) of Lemma 1."""
    if s == TANH:
        return log_cosh(xi)
    if s == ALGEBRAIC:
        return root(xi) - 1.0
    return _SCALE * (xi * atan(xi) - log(root(xi)))


def log_cosh(xi: float) -> float:
    """Integral of tanh from 0 to xi: ln(cosh(xi)), without overflow."""
    return abs(xi) + log1p(exp(-2.0 * abs(xi))) - log(2.0)
