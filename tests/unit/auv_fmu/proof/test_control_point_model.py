"""(4) to (8), (14), (15) and the properties of (15) that the proof rests on."""

import numpy as np
import pytest
from hypothesis import given

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import control_point_velocity
from auv_fmu.proof.control_point_model import (
    C_2,
    D_2,
    G_2,
    M_2,
    ActuatedDynamics,
    J,
    J_dot,
    kinematic_disturbance,
    kinematic_matrix,
)
from auv_fmu.vehicle import Vehicle, accelerations, euler_rates
from support.strategies import angles, forces, lengths, pitch_angles, speeds, vectors

VEHICLE, ELL = Vehicle(), 0.35
MODEL = ActuatedDynamics(VEHICLE)


@given(theta=pitch_angles, psi=angles, nu=vectors(speeds, 5))
def test_equation_4_is_equation_1(theta, psi, nu):
    u, v, w, q, r = nu
    rate = kinematic_matrix(theta, psi) @ (u, q, r)
    rate += kinematic_disturbance(theta, psi, np.array([v, w]))
    position = np.column_stack(rotation_from_euler(0.0, theta, psi)) @ (u, v, w)
    np.testing.assert_allclose(rate, [*position, *euler_rates(theta, q, r)], atol=1e-13)


@given(theta=pitch_angles, nu=vectors(speeds, 5), tau=vectors(forces, 3), tau_w=vectors(speeds, 5))
def test_equations_6_and_7_are_equation_2(theta, nu, tau, tau_w):
    u, v, w, q, r = nu
    actuated, unactuated = np.array([u, q, r]), np.array([v, w])
    tau_w1, tau_w1_bar = np.array(tau_w)[[0, 3, 4]], np.array(tau_w)[[1, 2]]
    rate = np.linalg.solve(
        MODEL.M_1,
        tau - MODEL.C_1(unactuated) @ actuated - MODEL.D_1 @ actuated - MODEL.G_1(theta) - tau_w1,
    )
    rate_bar = np.linalg.solve(
        MODEL.M_1_bar, -MODEL.C_1_bar(actuated) - MODEL.D_1_bar @ unactuated - tau_w1_bar
    )
    du, dv, dw, dq, dr = accelerations(VEHICLE, nu, np.sin(theta), tau, tau_w)
    np.testing.assert_allclose(rate, [du, dq, dr], atol=1e-12)
    np.testing.assert_allclose(rate_bar, [dv, dw], atol=1e-12)


@given(theta=pitch_angles, psi=angles, nu=vectors(speeds, 5), tau=vectors(forces, 3))
def test_equation_14_holds_along_the_motion_of_the_vehicle(theta, psi, nu, tau):
    """M_1 J^-1 (d2y - dJ/dt v - dJ_delta/dt) + C_1 v + D_1 v + G_1 = tau_a.

    The acceleration of the control point is a central difference of (10) along (1) and (2), so
    it knows nothing of (14).
    """
    u, v, w, q, r = nu
    dtheta, dpsi = euler_rates(theta, q, r)
    rates = np.array(accelerations(VEHICLE, nu, np.sin(theta), tau, (0.0,) * 5))

    def velocity(t):
        rotation = rotation_from_euler(0.0, theta + t * dtheta, psi + t * dpsi)
        a, b, c, d, e = np.array(nu) + t * rates
        return np.array(control_point_velocity(rotation, (a, b, c, 0.0, d, e), ELL))

    def unactuated_velocity(t):
        rotation = rotation_from_euler(0.0, theta + t * dtheta, psi + t * dpsi)
        _, b, c, _, _ = np.array(nu) + t * rates
        return b * np.array(rotation[1]) + c * np.array(rotation[2])

    h = 1e-5
    ddy = (velocity(h) - velocity(-h)) / (2 * h)
    dJ_delta = (unactuated_velocity(h) - unactuated_velocity(-h)) / (2 * h)
    J_inverse = np.linalg.inv(J(theta, psi, ELL))
    actuated = J_inverse @ (velocity(0.0) - unactuated_velocity(0.0))
    left = (
        MODEL.M_1 @ J_inverse @ (ddy - J_dot(theta, psi, dtheta, dpsi, ELL) @ actuated - dJ_delta)
        + MODEL.C_1(np.array([v, w])) @ actuated
        + MODEL.D_1 @ actuated
        + MODEL.G_1(theta)
    )
    np.testing.assert_allclose(left, tau, atol=1e-4)


@given(theta=pitch_angles, psi=angles, rates=vectors(speeds, 2), ell=lengths)
def test_rate_of_the_jacobian_is_its_derivative(theta, psi, rates, ell):
    h = 1e-6
    difference = J(theta + h * rates[0], psi + h * rates[1], ell)
    difference -= J(theta - h * rates[0], psi - h * rates[1], ell)
    np.testing.assert_allclose(J_dot(theta, psi, *rates, ell), difference / (2 * h), atol=1e-7)


@given(theta=pitch_angles, psi=angles, x=vectors(speeds, 3), ell=lengths)
def test_p2_1_inertia_is_symmetric_and_bounded(theta, psi, x, ell):
    """The eigenvalues of M_2 are m11, m55/ell^2 and m66/ell^2 at every attitude."""
    M = M_2(VEHICLE, theta, psi, ell)
    eigenvalues = sorted([VEHICLE.m11, VEHICLE.m55 / ell**2, VEHICLE.m66 / ell**2])
    np.testing.assert_allclose(M, M.T, rtol=1e-10, atol=1e-9 * eigenvalues[-1])
    quadratic, square = x @ M @ np.array(x), np.dot(x, x)
    slack = 1e-9 * eigenvalues[-1] * square
    assert eigenvalues[0] * square - slack <= quadratic <= eigenvalues[-1] * square + slack


@given(theta=pitch_angles, psi=angles, dy=vectors(speeds, 3), x=vectors(speeds, 3))
def test_p2_2_rate_of_inertia_minus_twice_coriolis_is_skew(theta, psi, dy, x):
    """With the attitude turning as it does without sway and heave, as C_2 has it."""
    *_, dtheta, dpsi = kinematic_matrix(theta, psi) @ np.linalg.solve(J(theta, psi, ELL), dy)
    h = 1e-6
    M_2_dot = M_2(VEHICLE, theta + h * dtheta, psi + h * dpsi, ELL)
    M_2_dot = (M_2_dot - M_2(VEHICLE, theta - h * dtheta, psi - h * dpsi, ELL)) / (2 * h)
    skew = M_2_dot - 2 * C_2(VEHICLE, theta, psi, np.array(dy), ELL)
    scale = 1 + abs(dtheta) ** 3 + abs(dpsi) ** 3
    assert x @ skew @ np.array(x) == pytest.approx(0.0, abs=1e-4 * scale)


@given(theta=pitch_angles, psi=angles, dy=vectors(speeds, 3), k=speeds)
def test_p2_3_holds_for_parallel_velocities(theta, psi, dy, k):
    """C_2(x1) x2 = C_2(x2) x1 if x2 = k x1: C_2 is linear in the velocity (P2.4)."""
    x_1, x_2 = np.array(dy), k * np.array(dy)
    left = C_2(VEHICLE, theta, psi, x_1, ELL) @ x_2
    right = C_2(VEHICLE, theta, psi, x_2, ELL) @ x_1
    np.testing.assert_allclose(left, right, atol=1e-8 * (1 + np.abs(left).max()))


def test_p2_3_fails_for_other_velocities():
    """A counterexample to P2.3 with C_2 as printed below (15).

    At level attitude x1 = (1, 0, 0) is pure surge, x2 = (0, 1, 0) is yaw at r = 1/ell. The
    attitude does not turn under x1, so C_2(x1) = 0. Under x2 surge turns sideways:
    C_2(x2) x1 = -J^-T M_1 J^-1 (0, r, 0) = (0, -m66 / ell^3, 0).
    """
    x_1, x_2 = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(C_2(VEHICLE, 0.0, 0.0, x_1, ELL) @ x_2, 0.0, atol=1e-12)
    np.testing.assert_allclose(
        C_2(VEHICLE, 0.0, 0.0, x_2, ELL) @ x_1, [0.0, -VEHICLE.m66 / ELL**3, 0.0], atol=1e-9
    )


@given(theta=pitch_angles, psi=angles, x=vectors(speeds, 3), ell=lengths)
def test_p2_6_damping_is_bounded(theta, psi, x, ell):
    """The eigenvalues of D_2 are d11, d55/ell^2 and d66/ell^2 at every attitude."""
    eigenvalues = sorted([VEHICLE.d11, VEHICLE.d55 / ell**2, VEHICLE.d66 / ell**2])
    quadratic = x @ D_2(VEHICLE, theta, psi, ell) @ np.array(x)
    square = np.dot(x, x)
    slack = 1e-9 * eigenvalues[-1] * square
    assert eigenvalues[0] * square - slack <= quadratic <= eigenvalues[-1] * square + slack


@given(theta=pitch_angles, psi=angles)
def test_gravity_is_the_force_that_does_the_work_of_the_righting_moment(theta, psi):
    G = G_2(VEHICLE, theta, psi, ELL)
    np.testing.assert_allclose(J(theta, psi, ELL).T @ G, MODEL.G_1(theta), atol=1e-12)
    assert np.linalg.norm(G) <= VEHICLE.righting_pitch / ELL + 1e-12
