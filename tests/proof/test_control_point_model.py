"""(4) to (8), (14), (15), the properties of (15) that the proof rests on, and (20), (25), (28)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import control_point_velocity
from auv_fmu.paper.vehicle import Vehicle, accelerations, euler_rates
from support.control_point_model import (
    C_2,
    D_2,
    G_2,
    M_2,
    ActuatedDynamics,
    J,
    J_delta,
    J_dot,
    chi_1,
    chi_2,
    d,
    d_missing,
    drift,
    kinematic_disturbance,
    kinematic_matrix,
    tau_w2,
    xi,
)
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
        MODEL.M_1_bar, -MODEL.C_1_bar(actuated) @ actuated - MODEL.D_1_bar @ unactuated - tau_w1_bar
    )
    du, dv, dw, dq, dr = accelerations(VEHICLE, nu, np.sin(theta), tau, tau_w)
    np.testing.assert_allclose(rate, [du, dq, dr], atol=1e-12)
    np.testing.assert_allclose(rate_bar, [dv, dw], atol=1e-12)


def test_1_and_2_turn_a_body_on_which_nothing_acts():
    """A sphere in (2), at u = 1 m/s, that yaws at 0.6 rad/s with a pitch of 0.6 rad.

    (1) holds its roll, which takes p = -r tan(theta); (2) has no p. So its velocity along z goes
    from -sin(0.6) to sin(0.6) m/s in pi / 0.6 s, by the Runge-Kutta scheme of fourth order.
    """
    sphere = Vehicle(20.0, 20.0, 20.0, 5.0, 5.0, *(0.0,) * 6)

    def rate(x):
        _, theta, _, *nu = x
        u, _, w, q, r = nu
        dz = -u * np.sin(theta) + w * np.cos(theta)
        rest = accelerations(sphere, nu, np.sin(theta), (0.0,) * 3, (0.0,) * 5)
        return np.array([dz, *euler_rates(theta, q, r), *rest])

    x, n = np.array([0.0, 0.6, 0.0, 1.0, 0.0, 0.0, 0.0, 0.6]), 1000
    h, before = np.pi / 0.6 / n, rate(x)[0]
    for _ in range(n):
        a = rate(x)
        b = rate(x + h / 2 * a)
        c = rate(x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c))
    assert (before, rate(x)[0]) == pytest.approx((-np.sin(0.6), np.sin(0.6)), abs=1e-9)
    assert np.sin(0.6) == pytest.approx(0.56, abs=0.005)
    assert np.pi / 0.6 == pytest.approx(5.2, abs=0.05)


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


def acceleration(theta, psi, nu, tau, tau_w):
    """d2y/dt2 by (1) and (2): of R (u, v + ell r, w - ell q), by the product rule."""
    R = np.column_stack(rotation_from_euler(0.0, theta, psi))
    u, v, w, q, r = nu
    dtheta, dpsi = euler_rates(theta, q, r)
    omega = np.array([-dpsi * np.sin(theta), dtheta, dpsi * np.cos(theta)])
    du, dv, dw, dq, dr = accelerations(VEHICLE, nu, np.sin(theta), tau, tau_w)
    in_body = np.array([u, v + ELL * r, w - ELL * q])
    rate = np.array([du, dv + ELL * dr, dw - ELL * dq])
    return R @ (np.cross(omega, in_body) + rate)


@given(
    theta=pitch_angles,
    psi=angles,
    nu=vectors(speeds, 5),
    tau=vectors(forces, 3),
    tau_w=vectors(forces, 5),
)
def test_equation_15_holds_with_the_missing_term_of_d(theta, psi, nu, tau, tau_w):
    u, v, w, q, r = nu
    at, unactuated = (VEHICLE, theta, psi), np.array([v, w])
    in_body = (u, v, w, 0.0, q, r)
    dy = np.array(control_point_velocity(rotation_from_euler(0.0, theta, psi), in_body, ELL))
    tau_w1, tau_w1_bar = np.array(tau_w)[[0, 3, 4]], np.array(tau_w)[[1, 2]]
    ddy = acceleration(theta, psi, nu, tau, tau_w)
    as_printed = (
        M_2(*at, ELL) @ ddy
        + C_2(*at, dy, ELL) @ dy
        + D_2(*at, ELL) @ dy
        + d(*at, unactuated, dy, ELL)
        + G_2(*at, ELL)
        + tau_w2(*at, unactuated, tau_w1, tau_w1_bar, ELL)
    )
    missing = d_missing(*at, unactuated, dy, ELL)
    force = np.linalg.solve(J(theta, psi, ELL).T, tau)
    scale = 1.0 + np.abs(as_printed).max() + np.abs(missing).max()
    np.testing.assert_allclose(as_printed + missing, force, atol=1e-10 * scale)


def test_equation_15_as_printed_lacks_a_force():
    """Level, at u = 1 m/s and w = 0.1 m/s: m55 m11 u w / (m33 ell^3) = 43.7 N."""
    w = np.array([0.0, 0.1])
    missing = d_missing(VEHICLE, 0.0, 0.0, w, np.array([1.0, 0.0, 0.1]), ELL)
    by_c_1_bar = 22.5 * 25.0 * 1.0 * 0.1 / (30.0 * ELL**3)
    turning = C_2(VEHICLE, 0.0, 0.0, np.array([0.0, 0.0, 0.1]), ELL) @ [1.0, 0.0, 0.1]
    np.testing.assert_allclose(missing + turning, [0.0, 0.0, -by_c_1_bar], atol=1e-12)


@given(theta=pitch_angles, psi=angles, w=vectors(speeds, 2), dy=vectors(speeds, 3), k=speeds)
def test_what_d_lacks_is_linear_in_dy_and_in_w(theta, psi, w, dy, k):
    """So the proof keeps its form: the zetas grow with the bound on w of Assumption 1."""
    w, dy = np.array(w), np.array(dy)
    found = d_missing(VEHICLE, theta, psi, w, dy, ELL)
    for larger in (
        d_missing(VEHICLE, theta, psi, k * w, dy, ELL),
        d_missing(VEHICLE, theta, psi, w, k * dy, ELL),
    ):
        np.testing.assert_allclose(larger, k * found, atol=1e-9 * (1 + np.abs(found).max()))


@given(theta=pitch_angles, psi=angles, w=vectors(speeds, 2), ell=lengths)
def test_drift_does_not_depend_on_the_attitude(theta, psi, w, ell):
    """J^-1 J_delta, whose derivatives by eta and w are in (15)."""
    found = np.linalg.solve(J(theta, psi, ell), J_delta(theta, psi, np.array(w)))
    np.testing.assert_allclose(found, drift(ell) @ w, atol=1e-12 / ell)


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
    """For an attitude that turns as without sway and heave, as in C_2."""
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


def test_p2_2_fails_where_sway_and_heave_are_left_out():
    """The true rate of M_2 less twice C_2(eta, dy), at level attitude with a sway of 0.2 m/s.

    dy = J_delta: the vehicle does not turn, and M_2 is at rest, but C_2(eta, dy) is not zero. By
    hand its symmetric part has (m66 / ell^2 - m11) v / ell.
    """
    dy = J_delta(0.0, 0.0, np.array([0.2, 0.0]))
    C = C_2(VEHICLE, 0.0, 0.0, dy, ELL)
    symmetric = -(C + C.T)
    expected = (VEHICLE.m66 / ELL**2 - VEHICLE.m11) * 0.2 / ELL
    assert symmetric[0, 1] == pytest.approx(expected) and expected > 55.0


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


def test_no_c_2_has_both_p2_2_and_p2_3():
    """P2.3 determines a C_2 that is linear in the velocity, by polarisation, and P2.2 fails for it.

    C(x) y = (C_2(x) y + C_2(y) x) / 2 has the product C_2(dy) dy of (15). Under surge alone M_2 is
    at rest, so P2.2 asks for y^T C(x) y = 0: it is -m66 / (2 ell^3).
    """
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])

    def C(a, b):
        crossed = C_2(VEHICLE, 0.0, 0.0, a, ELL) @ b + C_2(VEHICLE, 0.0, 0.0, b, ELL) @ a
        return crossed / 2.0

    np.testing.assert_allclose(C_2(VEHICLE, 0.0, 0.0, x, ELL), 0.0, atol=1e-12)
    assert y @ C(x, y) == pytest.approx(-VEHICLE.m66 / (2.0 * ELL**3))


@given(theta=pitch_angles, psi=angles, x=vectors(speeds, 3), y=vectors(speeds, 3))
def test_christoffel_symbols_have_both_p2_2_and_p2_3(theta, psi, x, y):
    """<C(x) y, z> = (D_x M(y, z) + D_y M(x, z) - D_z M(x, y)) / 2, with D M = C_2 + C_2^T.

    P2.3 is its symmetry. It does the work of C_2 at z = y = x: what (15) has beside it does none.
    """

    def rate(a):
        C = C_2(VEHICLE, theta, psi, a, ELL)
        return C + C.T

    def symbols(a, b):
        along = np.array([a @ rate(e) @ b for e in np.eye(3)])
        return (rate(a) @ b + rate(b) @ a - along) / 2.0

    x, y = np.array(x), np.array(y)
    product = C_2(VEHICLE, theta, psi, x, ELL) @ x
    scale = 1.0 + np.abs(rate(x)).max() * 30.0 + np.abs(rate(y)).max() * 30.0
    assert y @ rate(x) @ y == pytest.approx(2.0 * y @ symbols(x, y), abs=1e-9 * scale)
    assert x @ product == pytest.approx(x @ symbols(x, x), abs=1e-9 * scale)


@pytest.mark.parametrize("degrees", [0.0, 80.0, 89.0])
def test_p2_4_fails_at_the_vertical(degrees):
    """Yaw at r = 1 / ell rolls the axes of (1) at r tan(theta): C_2 has m55 tan(theta) / ell^3."""
    theta = np.radians(degrees)
    starboard = np.array([0.0, 1.0, 0.0])
    found = np.linalg.norm(C_2(VEHICLE, theta, 0.0, starboard, ELL), 2)
    assert found >= VEHICLE.m55 * np.tan(theta) / ELL**3
    assert found == pytest.approx(
        np.hypot(VEHICLE.m55 * np.tan(theta), VEHICLE.m66) / ELL**3, rel=0.2
    )


@given(theta=angles, psi=angles, phi=angles, omega=vectors(speeds, 3), ell=lengths)
def test_p2_4_has_no_pole_with_the_full_rotation(theta, psi, phi, omega, ell):
    """J = R P and dJ/dt = R S(omega) P with the body's own rates: |C_2| <= lambda_M2 |omega|."""
    R = np.column_stack(rotation_from_euler(phi, theta, psi))
    P = J(0.0, 0.0, ell)
    p, q, r = omega
    S = np.array([[0.0, -r, q], [r, 0.0, -p], [-q, p, 0.0]])
    J_inverse = np.linalg.inv(R @ P)
    C = -J_inverse.T @ MODEL.M_1 @ J_inverse @ R @ S @ P @ J_inverse
    lambda_M2 = max(VEHICLE.m11, VEHICLE.m55 / ell**2, VEHICLE.m66 / ell**2)
    assert np.linalg.norm(C, 2) <= lambda_M2 * np.linalg.norm(omega) * (1.0 + 1e-9) + 1e-9


@given(speed=st.floats(0.0, 1e6))
def test_p2_5_fails_for_an_unbounded_velocity(speed):
    """d(x + h) - d(x) along x = (speed, 0, 0), at one h: it grows with the speed.

    d is quadratic: m66 m11 / (m22 ell^3) times the product of the velocities ahead and to the side.
    """
    still, h = np.zeros(2), np.array([0.0, 1.0, 0.0])
    x = np.array([speed, 0.0, 0.0])
    change = d(VEHICLE, 0.0, 0.0, still, x + h, ELL) - d(VEHICLE, 0.0, 0.0, still, x, ELL)
    expected = VEHICLE.m66 * VEHICLE.m11 / (VEHICLE.m22 * ELL**3) * speed
    np.testing.assert_allclose(change, [0.0, expected, 0.0], rtol=1e-9, atol=1e-9)


@given(
    theta=pitch_angles,
    psi=angles,
    w=vectors(speeds, 2),
    x_1=vectors(speeds, 3),
    x_2=vectors(speeds, 3),
)
def test_p2_5_holds_for_a_bounded_second_velocity(theta, psi, w, x_1, x_2):
    """(26) and (29) need no more: x_2 = dy_r there, and |dy_r| is bounded by (16).

    d = L(w) dy + Q(dy) with a quadratic Q, |Q(h)| <= k |h|^2 / 2: so the change of d is
    L(w) h + DQ(x_2) h + Q(h), within (|L(w)| + k |x_2|) |h| + k |h|^2 / 2.
    """
    at, w, x_1, x_2 = (VEHICLE, theta, psi), np.array(w), np.array(x_1), np.array(x_2)
    change = np.linalg.norm(d(*at, w, x_1, ELL) - d(*at, w, x_2, ELL))
    h = np.linalg.norm(x_1 - x_2)
    J_inverse = np.linalg.inv(J(theta, psi, ELL))
    of_w = np.linalg.norm(J_inverse.T @ MODEL.C_1(w) @ J_inverse, 2)
    k = VEHICLE.m11 * max(VEHICLE.m66 / VEHICLE.m22, VEHICLE.m55 / VEHICLE.m33) / ELL**3
    bound = (of_w + k * np.linalg.norm(x_2)) * h + k * h * h / 2.0
    assert change <= bound * (1.0 + 1e-9) + 1e-9


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


three = vectors(speeds, 3)


@given(
    theta=pitch_angles,
    psi=angles,
    w=vectors(speeds, 2),
    dy_r=three,
    ddy_r=three,
    r_1=three,
    r_2=three,
    force=vectors(forces, 3),
    tau_w2=vectors(forces, 3),
)
def test_error_dynamics_follow_from_15_except_for_p2_3(
    theta, psi, w, dy_r, ddy_r, r_1, r_2, force, tau_w2
):
    """M_2 dr_1/dt of (15) equals (20); less k_d M_2 r_2 it is (28).

    Both hold except for C_2(x_1) x_2 - C_2(x_2) x_1, which P2.3 takes to be zero.
    """
    at = (VEHICLE, theta, psi)
    w, dy_r, ddy_r, r_1, r_2, force, tau_w2 = map(
        np.array, (w, dy_r, ddy_r, r_1, r_2, force, tau_w2)
    )
    dy = dy_r + r_1
    M, D = M_2(*at, ELL), D_2(*at, ELL)

    def C(x):
        return C_2(*at, x, ELL)

    ddy = np.linalg.solve(
        M, force - C(dy) @ dy - D @ dy - d(*at, w, dy, ELL) - G_2(*at, ELL) - tau_w2
    )
    found = M @ (ddy - ddy_r)
    lumped = xi(*at, w, dy_r, ddy_r, tau_w2, ELL)
    scale = 1.0 + np.abs(found).max() + np.abs(C(dy)).max() * 10.0
    by_20 = force - C(dy) @ r_1 - D @ r_1 + chi_1(*at, w, dy_r, r_1, ELL) + lumped
    crossed = C(dy_r) @ r_1 - C(r_1) @ dy_r
    np.testing.assert_allclose(found, by_20 + crossed, atol=1e-10 * scale)
    by_28 = force - C(dy) @ r_2 + chi_2(*at, w, dy_r, r_1, r_2, ELL) + lumped
    crossed = C(r_1) @ dy_r - C(dy_r) @ r_1
    np.testing.assert_allclose(found, by_28 + crossed, atol=1e-10 * scale)


@pytest.mark.slow
def test_15_needs_one_more_term():
    """J^T times (15), at the acceleration that (1) and (2) give, less tau_a.

    As printed, with the rate of J along the motion, it is off by
    M_1 d(J^-1 J_delta)/dw M_1_bar^-1 C_1_bar(J^-1 dy) J^-1 J_delta.
    """
    sp = pytest.importorskip("sympy", reason="needs the extra `test`")
    theta, psi, u, v, w, q, r = symbols = sp.symbols("theta psi u v w q r")
    ell, m11, m22, m33, m55, m66 = sp.symbols("ell m11 m22 m33 m55 m66", positive=True)
    d11, d22, d33, d55, d66, righting = sp.symbols("d11 d22 d33 d55 d66 righting")
    tau_u, tau_q, tau_r = tau = sp.symbols("tau_u tau_q tau_r")
    w_u, w_v, w_w, w_q, w_r = sp.symbols("tau_wu tau_wv tau_ww tau_wq tau_wr")
    c_theta, s_theta, c_psi, s_psi = sp.cos(theta), sp.sin(theta), sp.cos(psi), sp.sin(psi)

    rates = (
        q,
        r / c_theta,
        (m22 * v * r - m33 * w * q - d11 * u + tau_u - w_u) / m11,
        (-m11 * u * r - d22 * v - w_v) / m22,
        (m11 * u * q - d33 * w - w_w) / m33,
        ((m33 - m11) * u * w - d55 * q - righting * s_theta + tau_q - w_q) / m55,
        ((m11 - m22) * u * v - d66 * r + tau_r - w_r) / m66,
    )

    def dot(x):
        return sum(
            (x.diff(symbol) * rate for symbol, rate in zip(symbols, rates, strict=True)),
            sp.zeros(*x.shape),
        )

    def vanishes(x):
        """True if all entries are zero; r / cos(theta) is their only quotient."""
        plain = dict(zip((c_theta, s_theta, c_psi, s_psi), sp.symbols("a b c d"), strict=True))
        a, b, c, d = plain.values()
        for entry in x:
            left = sp.expand(sp.expand(entry * c_theta).subs(plain))
            left = sp.rem(left, a**2 + b**2 - 1, b)
            if sp.expand(sp.rem(sp.expand(left), c**2 + d**2 - 1, d)) != 0:
                return False
        return True

    J = sp.Matrix(
        [
            [c_psi * c_theta, -ell * s_theta * c_psi, -ell * s_psi],
            [s_psi * c_theta, -ell * s_theta * s_psi, ell * c_psi],
            [-s_theta, -ell * c_theta, 0],
        ]
    )
    J_delta = sp.Matrix(
        [-v * s_psi + w * s_theta * c_psi, v * c_psi + w * s_theta * s_psi, w * c_theta]
    )
    # The columns of J are orthogonal, of the lengths 1, ell and ell.
    J_inverse = sp.diag(1, 1 / ell**2, 1 / ell**2) * J.T
    drift = sp.Matrix([0, -w / ell, v / ell])
    assert vanishes(J_inverse * J - sp.eye(3))
    assert vanishes(J_inverse * J_delta - drift)

    dy = J * sp.Matrix([u, q, r]) + J_delta
    M_1, D_1 = sp.diag(m11, m55, m66), sp.diag(d11, d55, d66)
    C_1 = sp.Matrix([[0, m33 * w, -m22 * v], [(m11 - m33) * w, 0, 0], [(m22 - m11) * v, 0, 0]])
    T = M_1 * drift.jacobian([v, w]) * sp.diag(1 / m22, 1 / m33)

    def C_1_bar(x):
        return sp.Matrix([[0, 0, m11 * x[0]], [0, -m11 * x[0], 0]])

    a = sp.Matrix([u, q, r]) + drift  # J^-1 dy, by (13)
    printed_d = (C_1 - 2 * T * C_1_bar(drift)) * a + T * C_1_bar(a) * a
    printed_tau_w2 = (
        -(C_1 + D_1) * drift
        + sp.Matrix([w_u, w_q, w_r])
        + T * (sp.diag(d22, d33) * sp.Matrix([v, w]) + sp.Matrix([w_v, w_w]))
        + T * C_1_bar(drift) * drift
    )
    left = (
        M_1 * J_inverse * (dot(dy) - dot(J) * J_inverse * dy)
        + D_1 * a
        + sp.Matrix([0, righting * s_theta, 0])
        + printed_d
        + printed_tau_w2
    )
    missing = -T * C_1_bar(a) * drift
    assert not vanishes(left - sp.Matrix(tau))
    assert vanishes(left + missing - sp.Matrix(tau))
