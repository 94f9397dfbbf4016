"""Names for the tuples that the equations pass around."""

from __future__ import annotations

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
