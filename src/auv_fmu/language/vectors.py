"""Types of the tuples in the equations, and the algebra of three-vectors.

Python runs these functions several times as fast as the operators of :class:`.arrays.Vector`, which
are for users' components and longer vectors.

Functions that return a vector have names such as `add` for a + b, `sub` for a - b, and `scale` for
k a. `_scaled` means k b instead of b, `_diag` D b, with a diagonal matrix D given as its diagonal.
"""

from __future__ import annotations

from math import sqrt

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]
Vector5 = tuple[float, float, float, float, float]
Vector6 = tuple[float, float, float, float, float, float]

#: A rotation matrix R from body to earth as its columns (R e1, R e2, R e3): the directions of
#: the body axes in the earth frame.
Rotation = tuple[Vector3, Vector3, Vector3]

#: One number for each of as many points as a path may have.
Vector32 = tuple[
    float, float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float,
]  # fmt: skip


def add(a: Vector3, b: Vector3) -> Vector3:
    """The vector a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def sub(a: Vector3, b: Vector3) -> Vector3:
    """The vector a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(k: float, a: Vector3) -> Vector3:
    """The vector k a."""
    return k * a[0], k * a[1], k * a[2]


def add_scaled(a: Vector3, k: float, b: Vector3) -> Vector3:
    """The vector a + k b."""
    return a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]


def add_two_scaled(a: Vector3, k: float, b: Vector3, m: float, c: Vector3) -> Vector3:
    """The vector a + k b + m c."""
    return a[0] + k * b[0] + m * c[0], a[1] + k * b[1] + m * c[1], a[2] + k * b[2] + m * c[2]


def sub_scaled(a: Vector3, k: float, b: Vector3) -> Vector3:
    """The vector a - k b."""
    return a[0] - k * b[0], a[1] - k * b[1], a[2] - k * b[2]


def sub_diag(a: Vector3, D: Vector3, b: Vector3) -> Vector3:
    """The vector a - D b, with a diagonal matrix D."""
    return a[0] - D[0] * b[0], a[1] - D[1] * b[1], a[2] - D[2] * b[2]


def neg_diag(D: Vector3, a: Vector3) -> Vector3:
    """The vector -D a, with a diagonal matrix D."""
    return -D[0] * a[0], -D[1] * a[1], -D[2] * a[2]


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Cross product a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def distance(a: Vector3, b: Vector3) -> float:
    """The norm of a - b."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return sqrt(x * x + y * y + z * z)


def norm(a: Vector3) -> float:
    """Euclidean norm."""
    x, y, z = a
    return sqrt(x * x + y * y + z * z)
