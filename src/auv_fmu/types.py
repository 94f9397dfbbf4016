"""Names for the tuples that the equations pass around."""

from __future__ import annotations

from typing import Tuple

Vector3 = Tuple[float, float, float]
Vector4 = Tuple[float, float, float, float]
Vector5 = Tuple[float, float, float, float, float]
Vector6 = Tuple[float, float, float, float, float, float]

#: A rotation matrix R from body to earth as its columns (R e1, R e2, R e3): the directions of
#: the body axes in the earth frame.
Rotation = Tuple[Vector3, Vector3, Vector3]
