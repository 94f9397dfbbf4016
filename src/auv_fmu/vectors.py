"""The little algebra of vectors that the equations need."""

from __future__ import annotations

from math import sqrt

from auv_fmu.types import Vector3


def difference(a: Vector3, b: Vector3) -> Vector3:
    """The vector a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def distance(a: Vector3, b: Vector3) -> float:
    """The norm of a - b."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return sqrt(x * x + y * y + z * z)


def norm(x: Vector3) -> float:
    """Euclidean norm."""
    a, b, c = x
    return sqrt(a * a + b * b + c * c)
