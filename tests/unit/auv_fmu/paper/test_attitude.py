"""Rotation matrices, the unit quaternion and Euler angles against each other."""

from math import cos, pi, sin, tan

import numpy as np
import pytest
from hypothesis import given

from auv_fmu.paper.attitude import (
    euler_from_rotation,
    normalised,
    quaternion_from_euler,
    quaternion_rates,
    rotate,
    rotation_from_euler,
    rotation_from_quaternion,
)
from support.strategies import angles, pitch_angles, speeds, vectors


def elementary_rotation(axis: int, angle: float) -> np.ndarray:
    """Rotation about a coordinate axis by Rodrigues' formula."""
    k = np.eye(3)[axis]
    K = np.cross(k, np.eye(3)).T
    return np.eye(3) + sin(angle) * K + (1 - cos(angle)) * K @ K


@given(euler=vectors(angles, 3))
def test_rotation_is_yaw_then_pitch_then_roll(euler):
    phi, theta, psi = euler
    expected = (
        elementary_rotation(2, psi) @ elementary_rotation(1, theta) @ elementary_rotation(0, phi)
    )
    np.testing.assert_allclose(np.column_stack(rotation_from_euler(*euler)), expected, atol=1e-15)


@given(euler=vectors(angles, 3))
def test_quaternion_and_euler_angles_give_the_same_rotation(euler):
    quaternion = quaternion_from_euler(*euler)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(
        rotation_from_quaternion(quaternion), rotation_from_euler(*euler), atol=2e-15
    )


@given(phi=angles, theta=pitch_angles, psi=angles)
def test_euler_angles_come_back_from_their_rotation(phi, theta, psi):
    found = euler_from_rotation(rotation_from_euler(phi, theta, psi))
    given_angles = np.array([phi, theta, psi])
    np.testing.assert_allclose(np.exp(1j * np.array(found)), np.exp(1j * given_angles), atol=1e-13)


@pytest.mark.parametrize("theta", [pi / 2, -pi / 2])
@given(phi=angles, psi=angles)
def test_euler_angles_of_the_vertical_still_give_the_rotation(theta, phi, psi):
    rotation = rotation_from_euler(phi, theta, psi)
    again = rotation_from_euler(*euler_from_rotation(rotation))
    # asin loses half of the digits where its slope is infinite.
    np.testing.assert_allclose(again, rotation, atol=1e-7)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_rounding_beyond_one_does_not_leave_the_domain_of_asin(up):
    column = (0.0, 0.0, -up * (1.0 + 4e-16))
    _, theta, _ = euler_from_rotation((column, (0.0, 1.0, 0.0), (up, 0.0, 0.0)))
    assert theta == up * pi / 2


@given(phi=angles, theta=pitch_angles, psi=angles, omega=vectors(speeds, 3))
def test_quaternion_kinematics_agrees_with_euler_kinematics(phi, theta, psi, omega):
    """dq/dt from the body rates equals dq/dt through the Euler rates T_2 for any roll."""
    p, q, r = omega
    euler_rate = np.array(
        [
            p + tan(theta) * (q * sin(phi) + r * cos(phi)),
            q * cos(phi) - r * sin(phi),
            (q * sin(phi) + r * cos(phi)) / cos(theta),
        ]
    )
    euler, h = np.array([phi, theta, psi]), 1e-6
    forward = np.array(quaternion_from_euler(*(euler + h * euler_rate)))
    backward = np.array(quaternion_from_euler(*(euler - h * euler_rate)))
    expected = (forward - backward) / (2 * h)
    actual = quaternion_rates(quaternion_from_euler(phi, theta, psi), omega)
    np.testing.assert_allclose(actual, expected, atol=1e-8 * (1 + np.abs(euler_rate).max() ** 3))


@given(q=vectors(speeds, 4).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_normalising_keeps_the_direction(q):
    unit = np.array(normalised(q))
    assert np.linalg.norm(unit) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(unit * np.linalg.norm(q), q, rtol=1e-14, atol=1e-300)


@given(euler=vectors(angles, 3), x=vectors(speeds, 3))
def test_rotating_keeps_the_length(euler, x):
    assert np.linalg.norm(rotate(rotation_from_euler(*euler), x)) == pytest.approx(
        np.linalg.norm(x), abs=1e-14
    )
