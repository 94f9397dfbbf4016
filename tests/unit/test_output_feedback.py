"""The proposed controller against the paper's vector form, and its parts against analysis."""

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import output_feedback
from auv_fmu.adaptation import bound, regressor, robust_force, theta_hat_rate
from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import jacobian
from auv_fmu.observer import (
    initial_dy_hat_o,
    observer_acceleration,
    observer_velocity,
    velocity_estimate,
)
from auv_fmu.output_feedback import ControllerState, Gains, Measurement
from auv_fmu.saturation import SATURATIONS, algebraic, hyperbolic_tangent
from straight_line import closed_loop
from strategies import angles, speeds, vectors

NUMPY = {"tanh": np.tanh, "algebraic": lambda x: x / np.sqrt(1 + x**2)}
SLOPES = {"tanh": lambda x: 1 / np.cosh(x) ** 2, "algebraic": lambda x: (1 + x**2) ** -1.5}
three = vectors(speeds, 3)


@pytest.mark.parametrize("name", SATURATIONS)
@pytest.mark.parametrize("printed_jacobian", [True, False])
@given(
    y=three, euler=vectors(angles, 3), y_d=three, dy_d=three, ddy_d=three, y_hat=three,
    dy_o=three, theta_hat=vectors(st.floats(0, 20), 4), gains=vectors(st.floats(0.1, 20), 6),
)  # fmt: skip
def test_law_is_48_to_51_in_matrices(
    name, printed_jacobian, y, euler, y_d, dy_d, ddy_d, y_hat, dy_o, theta_hat, gains
):
    """(48), (49), (50), (51) and Remark 3 with numpy matrices, as the paper prints them."""
    s, s_slope = NUMPY[name], SLOPES[name]
    k_1, k_2, lam, k_d, eps_t, sigma = gains
    g = Gains(K1=(k_1, 2 * k_1, 3 * k_1), K2=(k_2, 3 * k_2, 2 * k_2), lambda_=lam, k_d=k_d,
              eps_t=eps_t, sigma=sigma, gamma=0.7, theta_0=(0.1, 0.2, 0.3, 0.4),
              s=SATURATIONS[name], printed_jacobian=printed_jacobian)  # fmt: skip
    signals = output_feedback.evaluate(
        g, ControllerState(y_hat, dy_o, theta_hat), Measurement(y, euler, y_d, dy_d, ddy_d)
    )
    y, y_d, dy_d, ddy_d, y_hat, dy_o, theta_hat = map(
        np.array, (y, y_d, dy_d, ddy_d, y_hat, dy_o, theta_hat)
    )
    Lambda, K_1, K_2 = lam * np.eye(3), np.diag(g.K1), np.diag(g.K2)
    e, z = y - y_d, y - y_hat
    dy_r = dy_d - Lambda @ s(e - z)
    dy_hat = dy_o + Lambda @ s(z) + k_d * z
    ddy_r = ddy_d - Lambda @ np.diag(s_slope(y_hat - y_d)) @ (dy_hat - dy_d)
    r = dy_hat - dy_d + Lambda @ s(y_hat - y_d) + Lambda @ s(z)
    G = np.array([1, np.linalg.norm(dy_r), np.linalg.norm(dy_r) ** 2, np.linalg.norm(ddy_r)])
    rho = G @ theta_hat
    phi, theta, psi = euler
    J = np.column_stack(
        jacobian(rotation_from_euler(0.0 if printed_jacobian else phi, theta, psi), g.ell)
    )
    tau = J.T @ (
        -K_1 @ s(dy_hat - Lambda @ s(z) - dy_r)
        - K_2 @ s(e - z)
        - K_2 @ s(z)
        - rho * np.tanh(0.2785 * rho * r / eps_t)
    )
    dtheta_hat = 0.7 * G * np.linalg.norm(r) - 0.7 * sigma * (theta_hat - g.theta_0)
    exact = {"rtol": 1e-9, "atol": 1e-9}
    np.testing.assert_allclose(signals.tau, tau, rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(signals.dy_hat, dy_hat, **exact)
    np.testing.assert_allclose(signals.e, e, **exact)
    np.testing.assert_allclose(signals.z, z, **exact)
    np.testing.assert_allclose(signals.ddy_hat_o, ddy_r + k_d * Lambda @ s(z), **exact)
    np.testing.assert_allclose(signals.dtheta_hat, dtheta_hat, **exact)


def test_observer_finds_a_constant_velocity():
    """With ddy_r = 0 its error obeys dz = -(k_d + lambda) z around rest: it dies out as exp."""
    lambda_, k_d, h, velocity = 1.0, 50.0, 1e-4, 0.4
    y_hat, dy_o, z = 0.0, velocity, 1e-3
    y = y_hat + z
    for _ in range(1000):
        s_z = hyperbolic_tangent(y - y_hat)[0]
        rate = velocity_estimate(dy_o, s_z, y - y_hat, lambda_, k_d)
        y_hat, y = y_hat + h * rate, y + h * velocity
    assert y - y_hat == pytest.approx(z * exp(-(k_d + lambda_) * 0.1), rel=0.02)
    assert velocity_estimate(dy_o, 0.0, 0.0, lambda_, k_d) == velocity


@given(s_z=speeds, z=speeds, lambda_=speeds, k_d=st.floats(0, 100))
def test_first_velocity_estimate_is_zero(s_z, z, lambda_, k_d):
    """The initial condition below (24) makes d y_hat/dt(0) = 0."""
    dy_o = initial_dy_hat_o(s_z, z, lambda_, k_d)
    assert velocity_estimate(dy_o, s_z, z, lambda_, k_d) == pytest.approx(0.0, abs=1e-12)


@given(y=speeds, y_hat=speeds, dy=speeds, dy_hat_o=speeds, ddy_r=speeds)
def test_observer_is_the_one_of_the_proof(y, y_hat, dy, dy_hat_o, ddy_r):
    """(18), (23) and (24) "are equivalent to" d/dt (r_1 - r_2) = k_d r_2, above (28).

    r_1 - r_2 = dy_o - dy_r. Its rate is a central difference along y, y_hat and dy_hat_o as they
    move; only with dy_o of (18), not with the state dy_hat_o in its place, is it k_d r_2.
    """
    lambda_, k_d, h = 0.7, 50.0, 1e-6
    s = hyperbolic_tangent
    dy_hat = velocity_estimate(dy_hat_o, s(y - y_hat)[0], y - y_hat, lambda_, k_d)
    ddy_hat_o = observer_acceleration(ddy_r, s(y - y_hat)[0], lambda_, k_d)

    def dy_o(t):
        z = y + t * dy - (y_hat + t * dy_hat)
        moved = velocity_estimate(dy_hat_o + t * ddy_hat_o, s(z)[0], z, lambda_, k_d)
        return observer_velocity(moved, s(z)[0], lambda_)

    rate = (dy_o(h) - dy_o(-h)) / (2 * h) - ddy_r
    r_2 = dy - observer_velocity(dy_hat, s(y - y_hat)[0], lambda_)
    assert rate == pytest.approx(k_d * r_2, rel=1e-6, abs=1e-4)


def test_observer_acceleration_is_equation_51():
    assert observer_acceleration(0.3, 0.5, 2.0, 50.0) == pytest.approx(0.3 + 50.0 * 2.0 * 0.5)


def test_adaptive_law_follows_the_analytic_solution_of_euler():
    """Under constant G and |r|, theta_hat -> theta_0 + G |r| / sigma, geometrically."""
    G, r, gamma, sigma, h, n = (1.0, 0.5, 0.25, 2.0), 0.3, 2.0, 0.5, 0.02, 400
    theta_0 = (1.0, 2.0, 3.0, 4.0)
    theta_hat = np.zeros(4)
    for _ in range(n):
        theta_hat += h * np.array(theta_hat_rate(G, r, tuple(theta_hat), theta_0, gamma, sigma))
    limit = np.array(theta_0) + np.array(G) * r / sigma
    expected = limit * (1 - (1 - h * gamma * sigma) ** n)
    np.testing.assert_allclose(theta_hat, expected, rtol=1e-12)


@given(velocity=three, acceleration=three, theta_hat=vectors(st.floats(0, 20), 4))
def test_bound_is_the_regressor_times_the_parameters(velocity, acceleration, theta_hat):
    G = regressor(velocity, acceleration)
    speed = np.linalg.norm(velocity)
    expected = [1.0, speed, speed**2, np.linalg.norm(acceleration)]
    np.testing.assert_allclose(G, expected, rtol=1e-14)
    assert bound(G, theta_hat) == pytest.approx(np.dot(expected, theta_hat))


@given(rho=st.floats(0, 1e3), r=speeds, eps_t=st.floats(0.01, 10))
def test_robust_force_opposes_the_error_and_is_bounded_by_rho(rho, r, eps_t):
    force = robust_force(rho, r, eps_t)
    assert abs(force) <= rho
    assert force * r >= 0.0


def test_first_three_terms_cannot_exceed_their_gains():
    """|F| <= k1 + 2 k2 on each axis for every error: what makes the controller saturated."""
    far = output_feedback.evaluate(
        Gains(), ControllerState((1e6,) * 3, (-1e6,) * 3, (0.0,) * 4),
        Measurement((-1e6,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3),
    )  # fmt: skip
    assert abs(far.tau[0]) <= 10.0 + 2 * 10.0 + 1e-9


def test_gate_restarts_the_observer_after_a_jump_only():
    gains = Gains(innovation_gate=1.0)
    state = ControllerState((0.0,) * 3, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0, 7.0))
    assert output_feedback.gated(gains, state, (0.6, 0.6, 0.5)) is state
    restarted = output_feedback.gated(gains, state, (0.6, 0.6, 0.6))
    assert restarted == ((0.6, 0.6, 0.6), (0.0, 0.0, 0.0), state.theta_hat)
    assert output_feedback.gated(gains._replace(innovation_gate=0.0), state, (9.0,) * 3) is state


@pytest.mark.parametrize("s", [hyperbolic_tangent, algebraic])
def test_closed_loop_of_either_saturation_function_converges(s):
    """Theorem 2: the tracking error ends in a ball; 10 cm in 60 s from 6 m for our numbers."""
    *_, last = closed_loop(3000, noise_std=0.0, gains=Gains(s=s))
    assert np.abs(last.signals.e).max() < 0.1
