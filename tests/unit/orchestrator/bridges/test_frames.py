"""Frames of ROS, compared with axes found by hand, and with products of matrices."""

from __future__ import annotations

from math import radians, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orchestrator.bridges import frames

ANGLES = st.floats(-3.2, 3.2)

#: Axes of east, north, up in north, east, down; forward, port, up in forward, starboard, down.
EARTH = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
BODY = np.diag([1, -1, -1])


def axes(phi: float, theta: float, psi: float) -> np.ndarray:
    """Forward, port and up of the vehicle as rows, in east, north, up."""
    rotation = Rotation.from_quat(frames.attitude(phi, theta, psi), scalar_first=True)
    return rotation.as_matrix().T


@pytest.mark.parametrize(
    ("euler", "forward", "port", "up"),
    [
        # Level, with the nose to the east, to the north, to the south-west.
        ((0, 0, 90), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 0, 0), (0, 1, 0), (-1, 0, 0), (0, 0, 1)),
        ((0, 0, -135), (-sqrt(0.5), -sqrt(0.5), 0), (sqrt(0.5), -sqrt(0.5), 0), (0, 0, 1)),
        # To the east, with the nose 30 degrees up.
        ((0, 30, 90), (sqrt(0.75), 0, 0.5), (0, 1, 0), (-0.5, 0, sqrt(0.75))),
        # To the east, on the starboard side.
        ((90, 0, 90), (1, 0, 0), (0, 0, 1), (0, -1, 0)),
    ],
)
def test_attitude_has_the_axes_found_by_hand(euler, forward, port, up):
    np.testing.assert_allclose(axes(*map(radians, euler)), [forward, port, up], atol=1e-15)


@given(ANGLES, ANGLES, ANGLES)
def test_attitude_is_the_vehicles_between_both_pairs_of_frames(phi, theta, psi):
    paper = Rotation.from_euler("ZYX", [psi, theta, phi]).as_matrix()
    np.testing.assert_allclose(axes(phi, theta, psi).T, EARTH @ paper @ BODY, atol=1e-14)


@given(st.tuples(*[st.floats(allow_nan=False)] * 3))
def test_vectors_are_turned_without_rounding_and_back(vector):
    with np.errstate(invalid="ignore"):
        assert frames.earth(frames.earth(vector)) == frames.body(frames.body(vector)) == vector
    north, east, down = vector
    assert frames.earth(vector) == (east, north, -down)
    forward, starboard, down = vector
    assert frames.body(vector) == (forward, -starboard, -down)
