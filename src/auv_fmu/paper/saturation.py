"""Saturation functions: Definition 2, the subject of Lemma 1 and Theorem 2.

As in section 2.1 and above Theorem 2 they act on vectors, component by component.
"""

from __future__ import annotations

from enum import IntEnum
from math import atan, exp, log, log1p, pi, sqrt, tanh

from auv_fmu.language.vectors import Vector3


class Saturation(IntEnum):
    """A saturation function: those named in the paper, and one more."""

    TANH = 0  #: tanh(xi)
    ALGEBRAIC = 1  #: xi / sqrt(1 + xi^2)
    ARCTAN = 2  #: (2 / pi) atan(xi), with another slope, which Theorem 2 weights K_1 with


#: Module-level names, which Python looks up faster than members of the class.
TANH, ALGEBRAIC, ARCTAN = Saturation

#: Scales the arc tangent to the bound M = 1; also its slope at 0.
_SCALE = 2.0 / pi

#: Largest slope s'_M of Lemma 1 of each.
MAXIMUM_SLOPE = {Saturation.TANH: 1.0, Saturation.ALGEBRAIC: 1.0, Saturation.ARCTAN: _SCALE}

#: From here on 1 + xi^2 is xi^2 apart from rounding; xi^2 may overflow.
_LARGE = 1e9


def saturation(s: Saturation, xi: Vector3) -> Vector3:
    """s(xi) of the saturation function s, with M = 1."""
    if s == TANH:
        return tanh(xi[0]), tanh(xi[1]), tanh(xi[2])
    if s == ALGEBRAIC:
        return xi[0] / root(xi[0]), xi[1] / root(xi[1]), xi[2] / root(xi[2])
    return _SCALE * atan(xi[0]), _SCALE * atan(xi[1]), _SCALE * atan(xi[2])


def slope(s: Saturation, xi: Vector3, s_xi: Vector3) -> Vector3:
    """Diagonal of S'(xi): Sech^2(xi), (1 + xi_i^2)^(-3/2), or (2 / pi) / (1 + xi_i^2).

    Args:
        s: the saturation function.
        xi: its argument.
        s_xi: s(xi).

    """
    if s == TANH:
        return 1.0 - s_xi[0] * s_xi[0], 1.0 - s_xi[1] * s_xi[1], 1.0 - s_xi[2] * s_xi[2]
    if s == ALGEBRAIC:
        r_1, r_2, r_3 = root(xi[0]), root(xi[1]), root(xi[2])
        return 1.0 / (r_1 * r_1 * r_1), 1.0 / (r_2 * r_2 * r_2), 1.0 / (r_3 * r_3 * r_3)
    return (
        _SCALE / (1.0 + xi[0] * xi[0]),
        _SCALE / (1.0 + xi[1] * xi[1]),
        _SCALE / (1.0 + xi[2] * xi[2]),
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
