"""Rotations as unit quaternions and rotation vectors, after Solà (2017), chapters 1 and 2.

Joan Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508. Quaternions
are (w, x, y, z), their product is Hamilton's, and they turn the body frame into the earth frame.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

from auv_fmu.language.vectors import Vector3, Vector4, norm

#: Below this angle [rad] sines are series of one term: the next one is under a rounding error.
_SMALL = 1e-8


def product(a: Vector4, b: Vector4) -> Vector4:
    """Hamilton's product: the rotation b, then a."""
    a0, a1, a2, a3 = a
    b0, b1, b2, b3 = b
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


def inverse(a: Vector4) -> Vector4:
    """The rotation back: the conjugate."""
    return a[0], -a[1], -a[2], -a[3]


def exponential(theta: Vector3) -> Vector4:
    """The quaternion of a rotation vector [rad]."""
    angle = norm(theta)
    share = 0.5 if angle < _SMALL else sin(0.5 * angle) / angle
    return cos(0.5 * angle), share * theta[0], share * theta[1], share * theta[2]


def logarithm(a: Vector4) -> Vector3:
    """The rotation vector [rad] of a quaternion, at most pi long."""
    w, x, y, z = a if a[0] >= 0.0 else (-a[0], -a[1], -a[2], -a[3])
    length = sqrt(x * x + y * y + z * z)
    share = 2.0 / w if length < _SMALL else 2.0 * atan2(length, w) / length
    return share * x, share * y, share * z
