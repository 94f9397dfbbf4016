"""The body of a vehicle that pages and films show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orchestrator.figures.style import COLOURS, REFERENCE

#: Distance behind the nose and radius of the rings of the hull, as shares of its length.
RINGS = (
    (0.0, 0.0),
    (0.02, 0.04),
    (0.08, 0.075),
    (0.18, 0.09),
    (0.7, 0.09),
    (0.9, 0.05),
    (1, 0.02),
)

#: Sides of the hull.
_SIDES = 12

#: Corners of the upper fin, as shares of the length behind the nose and above the axis.
FIN = ((0.74, 0.05), (0.84, 0.22), (0.94, 0.22), (0.94, 0.03))

#: Axes of the paper's words, whose z is up, in axes whose z is down; in the earth and in the body.
Z_UP = np.array([1.0, -1.0, -1.0])

#: Colours of the hull, the upper fin, which shows the roll, and the other fins.
PAINT = (COLOURS[5], COLOURS[0], REFERENCE)

#: The upper fin of one of several vehicles, whose hull has the colour of its own.
_DARK = "#222222"


class Body(NamedTuple):
    """Triangles of a vehicle of length 1, its nose in the origin.

    Attributes:
        points: in the body frame, x ahead, y to starboard, z down; (n, 3).
        triangles: of points, (m, 3).
        part: of each triangle, an index of :data:`PAINT`.

    """

    points: np.ndarray
    triangles: np.ndarray
    part: np.ndarray


def body() -> Body:
    """Hull and fins."""
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    points = [
        (-behind, radius * np.cos(a), radius * np.sin(a))
        for behind, radius in RINGS
        for a in angles
    ]
    triangles = []
    for ring in range(len(RINGS) - 1):
        for side in range(_SIDES):
            a, b = ring * _SIDES + side, ring * _SIDES + (side + 1) % _SIDES
            triangles += [(a, b, a + _SIDES), (b, b + _SIDES, a + _SIDES)]
    parts = [0] * len(triangles)
    # Up, to starboard, down, to port.
    for i, (y, z) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
        n = len(points)
        points += [(-behind, height * y, height * z) for behind, height in FIN]
        triangles += [(n, n + 1, n + 2), (n, n + 2, n + 3)]
        parts += [2 if i else 1] * 2
    return Body(np.array(points), np.array(triangles), np.array(parts))


def paint_of(colour: str) -> tuple[str, str, str]:
    """Colours in place of :data:`PAINT` for a vehicle with a colour of its own."""
    return colour, _DARK, REFERENCE
