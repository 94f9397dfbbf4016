"""(9) to (13) as printed, and with roll."""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given

from auv_fmu.paper.attitude import rotation_from_euler, rotation_from_quaternion
from auv_fmu.paper.control_point import (
    actuated_velocity,
    actuator_command,
    control_point,
    control_point_velocity,
)
from auv_fmu.paper.plant import Parameters, advance, begin, outputs
from support.control_point_model import jacobian
from support.strategies import angles, forces, lengths, pitch_angles, speeds, vectors


@given(theta=angles, psi=angles, position=vectors(speeds, 3), ell=lengths)
def test_control_point_is_equation_9(theta, psi, position, ell):
    x, y, z = position
    expected = (
        x + ell * cos(theta) * cos(psi),
        y + ell * cos(theta) * sin(psi),
        z - ell * sin(theta),
    )
    rotation = rotation_from_euler(0.0, theta, psi)
    np.testing.assert_allclose(control_point(position, rotation, ell), expected, atol=1e-15)


@given(theta=angles, psi=angles, ell=lengths)
def test_jacobian_is_equation_11(theta, psi, ell):
    printed = np.array(
        [
            [cos(psi) * cos(theta), -ell * sin(theta) * cos(psi), -ell * sin(psi)],
            [sin(psi) * cos(theta), -ell * sin(theta) * sin(psi), ell * cos(psi)],
            [-sin(theta), -ell * cos(theta), 0.0],
        ]
    )
    J = np.column_stack(jacobian(rotation_from_euler(0.0, theta, psi), ell))
    np.testing.assert_allclose(J, printed, atol=1e-15)


@given(euler=vectors(angles, 3), ell=lengths)
def test_jacobian_is_regular_for_every_attitude(euler, ell):
    """|det J| = ell^2: no singularity, as stated below (12)."""
    J = np.column_stack(jacobian(rotation_from_euler(*euler), ell))
    assert abs(np.linalg.det(J)) == pytest.approx(ell**2, rel=1e-12)


@given(theta=pitch_angles, psi=angles, nu=vectors(speeds, 5), ell=lengths)
def test_velocity_is_the_sum_of_11_and_12(theta, psi, nu, ell):
    u, v, w, q, r = nu
    rotation = rotation_from_euler(0.0, theta, psi)
    J_delta = np.array(
        [
            -v * sin(psi) + w * sin(theta) * cos(psi),
            v * cos(psi) + w * sin(theta) * sin(psi),
            w * cos(theta),
        ]
    )
    expected = np.column_stack(jacobian(rotation, ell)) @ (u, q, r) + J_delta
    actual = control_point_velocity(rotation, (u, v, w, 0.0, q, r), ell)
    np.testing.assert_allclose(actual, expected, atol=1e-13)


@given(euler=vectors(angles, 3), nu=vectors(speeds, 6), ell=lengths)
def test_equation_13_gives_the_velocity_back(euler, nu, ell):
    u, v, w, _, q, r = nu
    rotation = rotation_from_euler(*euler)
    dy = control_point_velocity(rotation, nu, ell)
    assert actuated_velocity(rotation, dy, (v, w), ell) == pytest.approx((u, q, r), abs=1e-12)


@given(euler=vectors(angles, 3), force=vectors(forces, 3), ell=lengths)
def test_command_does_the_work_of_the_force(euler, force, ell):
    """tau_a = J' F is the transpose of the map of velocities: the virtual work agrees."""
    rotation = rotation_from_euler(*euler)
    expected = np.column_stack(jacobian(rotation, ell)).T @ force
    np.testing.assert_allclose(actuator_command(rotation, force, ell), expected, atol=1e-12)


def test_velocity_is_the_derivative_of_the_position_of_a_vehicle_that_rolls_in_a_current():
    """(10) with the full rotation against a central difference of (9) along a motion."""
    nu, h = (0.8, -0.3, 0.2, 0.7, -0.5, 0.9), 1e-5
    current = (0.3, -0.4, 0.2)
    parameters = Parameters(eta0=(1.0, 2.0, 3.0, 0.9, -0.6, 2.0), nu0=nu, current=current)
    state = begin(parameters, current)
    rotation = rotation_from_quaternion(state.quaternion)

    def moved_y(dt):
        still = (0.0,) * 3, (0.0,) * 6, current, (0.0,) * 3
        moved = advance(parameters, state, rotation, *still, dt)
        return outputs(moved, rotation_from_quaternion(moved.quaternion), 0.35, True).y

    difference = np.subtract(moved_y(h), moved_y(-h)) / (2 * h)
    np.testing.assert_allclose(outputs(state, rotation, 0.35, True).dy, difference, atol=1e-8)
