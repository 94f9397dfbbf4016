"""The proposed controller against the paper's vector form, and its parts against analysis."""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper import output_feedback
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.observer import Form
from auv_fmu.paper.output_feedback import ControllerState, Gains, Measurement
from auv_fmu.paper.saturation import Saturation
from support.control_point_model import jacobian
from support.strategies import angles, speeds, vectors

NUMPY = {
    Saturation.TANH: np.tanh,
    Saturation.ALGEBRAIC: lambda x: x / np.sqrt(1 + x**2),
    Saturation.ARCTAN: lambda x: 2 / np.pi * np.arctan(x),
}
SLOPES = {
    Saturation.TANH: lambda x: 1 / np.cosh(x) ** 2,
    Saturation.ALGEBRAIC: lambda x: (1 + x**2) ** -1.5,
    Saturation.ARCTAN: lambda x: 2 / np.pi / (1 + x**2),
}
three = vectors(speeds, 3)


@pytest.mark.parametrize("function", Saturation)
@pytest.mark.parametrize(
    ("form", "printed_jacobian"), [(Form.EULER, True), (Form.EULER, False), (Form.INTEGRAL, False)]
)
@given(
    y=three, euler=vectors(angles, 3), y_d=three, dy_d=three, ddy_d=three, y_hat=three,
    dy_hat_o=three, theta_hat=vectors(st.floats(0, 20), 4), gains=vectors(st.floats(0.1, 20), 6),
)  # fmt: skip
def test_law_is_48_to_51_in_matrices(
    function, form, printed_jacobian, y, euler, y_d, dy_d, ddy_d, y_hat, dy_hat_o, theta_hat, gains
):
    """(48), (49), (50), (51) and Remark 3 with numpy matrices, as the paper prints them.

    Where (24) is integrated as printed, the state is its integral, without dy_r.
    """
    s, s_slope = NUMPY[function], SLOPES[function]
    k_1, k_2, lam, k_d, eps_t, sigma = gains
    g = Gains(
        K1=(k_1, 2 * k_1, 3 * k_1),
        K2=(k_2, 3 * k_2, 2 * k_2),
        lambda_=lam,
        k_d=k_d,
        eps_t=eps_t,
        sigma=sigma,
        gamma=0.7,
        theta_0=(0.1, 0.2, 0.3, 0.4),
        s=function,
        printed_jacobian=printed_jacobian,
        form=form,
    )
    state = ControllerState(y_hat, dy_hat_o, theta_hat, 0.0)
    signals = output_feedback.evaluate(g, state, Measurement(y, euler, y_d, dy_d, ddy_d), 0.02)
    moved = output_feedback.step(state, signals, 0.02)
    y, y_d, dy_d, ddy_d, y_hat, dy_hat_o, theta_hat = map(
        np.array, (y, y_d, dy_d, ddy_d, y_hat, dy_hat_o, theta_hat)
    )
    Lambda, K_1, K_2 = lam * np.eye(3), np.diag(g.K1), np.diag(g.K2)
    e, z = y - y_d, y - y_hat
    dy_r = dy_d - Lambda @ s(e - z)
    dy_hat = dy_hat_o + Lambda @ s(z) + k_d * z + (dy_r if form == Form.INTEGRAL else 0)
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
    ddy_hat_o = k_d * Lambda @ s(z) + (0 if form == Form.INTEGRAL else ddy_r)
    np.testing.assert_allclose(signals.ddy_hat_o, ddy_hat_o, **exact)
    np.testing.assert_allclose(signals.dtheta_hat, dtheta_hat, **exact)
    np.testing.assert_allclose(moved.y_hat, y_hat + 0.02 * dy_hat, **exact)
    np.testing.assert_allclose(moved.dy_hat_o, dy_hat_o + 0.02 * ddy_hat_o, **exact)
    np.testing.assert_allclose(moved.theta_hat, theta_hat + 0.02 * dtheta_hat, **exact)


def test_first_three_terms_cannot_exceed_their_gains():
    """|F| <= k1 + 2 k2 on each axis for every error: what makes the controller saturated."""
    far = output_feedback.evaluate(
        Gains(),
        ControllerState((1e6,) * 3, (-1e6,) * 3, (0.0,) * 4, 0.0),
        Measurement((-1e6,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3),
        0.02,
    )
    assert abs(far.tau[0]) <= 10.0 + 2 * 10.0 + 1e-9


def test_gate_restarts_the_observer_after_a_jump_only():
    gains = Gains(innovation_gate=1.0)
    state = ControllerState((0.0,) * 3, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0, 7.0), 0.0)
    assert output_feedback.gated(gains, state, (0.6, 0.6, 0.5)) is state
    # The gate is the largest jump that is credible.
    assert output_feedback.gated(gains, state, (0.0, 1.0, 0.0)) is state
    restarted = output_feedback.gated(gains, state, (0.6, 0.6, 0.6))
    assert restarted == ((0.6, 0.6, 0.6), (0.0, 0.0, 0.0), state.theta_hat, 0.0)
    assert output_feedback.gated(gains._replace(innovation_gate=0.0), state, (9.0,) * 3) is state


ORIGIN = (0.0, 0.0, 0.0)


def estimates(gains, h, end, dy_hat_o=ORIGIN):
    """dy_hat along y = y_d = (sin t, 0, 0), as the controller's own observer makes it."""
    state = ControllerState(ORIGIN, dy_hat_o, (0.0,) * 4, 0.0)
    found = []
    for k in range(round(end / h) + 1):
        t = k * h
        y, dy, ddy = (sin(t), 0.0, 0.0), (cos(t), 0.0, 0.0), (-sin(t), 0.0, 0.0)
        signals = output_feedback.evaluate(gains, state, Measurement(y, ORIGIN, y, dy, ddy), h)
        state = output_feedback.step(state, signals, h)
        found.append(signals.dy_hat[0])
    return np.array(found)


def test_printed_24_and_its_rate_51_are_one_where_they_begin_alike():
    """From dy_hat_o(0) = 0, the integral being -dy_r(0): what differs is Euler's error, O(h)."""
    differences = []
    for h in (0.002, 0.001):
        of_24 = estimates(Gains(form=Form.INTEGRAL), h, 2.0, dy_hat_o=(-1.0, 0.0, 0.0))
        differences.append(np.abs(of_24 - estimates(Gains(), h, 2.0)).max())
    assert differences[1] == pytest.approx(differences[0] / 2, rel=0.05)
    assert differences[1] < 2e-3


def test_printed_24_shows_the_desired_velocity_first_and_not_zero():
    """Its integral begins at zero, so dy_hat(0) = dy_r(0): not the condition below (24)."""
    assert estimates(Gains(form=Form.INTEGRAL), 0.02, 0.0)[0] == 1.0
    assert estimates(Gains(), 0.02, 0.0)[0] == 0.0


@pytest.mark.parametrize("k_d", [50.0, 500.0, 5000.0])
def test_exact_observer_follows_with_any_gain_in_steps_of_20_ms(k_d):
    """sin t is followed as well as k_d h = 1 is by Euler's scheme, which k_d h = 2 breaks."""
    gains = Gains(k_d=k_d, form=Form.EXACT)
    late = slice(100, None)
    true = np.cos(np.arange(251) * 0.02)[late]
    assert np.abs(estimates(gains, 0.02, 5.0)[late] - true).max() < 0.02
