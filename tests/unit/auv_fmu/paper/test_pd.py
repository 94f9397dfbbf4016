"""The baseline against the paper's vector form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper import pd
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.pd import PdGains, PdMeasurement
from support.control_point_model import jacobian
from support.strategies import angles, speeds, vectors

three = vectors(speeds, 3)


@pytest.mark.parametrize("printed_jacobian", [True, False])
@given(
    y=three, euler=vectors(angles, 3), y_d=three, dy_d=three, ddy_d=three, dy=three,
    theta_hat=vectors(st.floats(0, 20), 4), gains=vectors(st.floats(0.1, 20), 4),
)  # fmt: skip
def test_law_is_57_and_58_in_matrices(
    printed_jacobian, y, euler, y_d, dy_d, ddy_d, dy, theta_hat, gains
):
    k_1, lam, eps_t, sigma = gains
    g = PdGains(
        K1=(k_1, 2 * k_1, 3 * k_1),
        lambda_=lam,
        eps_t=eps_t,
        sigma=sigma,
        gamma=0.7,
        theta_0=(0.1, 0.2, 0.3, 0.4),
        printed_jacobian=printed_jacobian,
    )
    signals = pd.evaluate(g, theta_hat, PdMeasurement(y, euler, y_d, dy_d, ddy_d, dy))
    e, de = np.subtract(y, y_d), np.subtract(dy, dy_d)
    r = de + lam * np.eye(3) @ e
    speed = np.linalg.norm(dy_d)
    G = np.array([1.0, speed, speed**2, np.linalg.norm(ddy_d)])
    rho = G @ theta_hat
    phi, theta, psi = euler
    J = np.column_stack(
        jacobian(rotation_from_euler(0.0 if printed_jacobian else phi, theta, psi), g.ell)
    )
    tau = J.T @ (-np.diag(g.K1) @ r - rho * np.tanh(0.2785 * rho * r / eps_t))
    dtheta_hat = 0.7 * G * np.linalg.norm(r) - 0.7 * sigma * np.subtract(theta_hat, g.theta_0)
    np.testing.assert_allclose(signals.tau, tau, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(signals.e, e, atol=1e-14)
    np.testing.assert_allclose(signals.dtheta_hat, dtheta_hat, rtol=1e-10, atol=1e-10)
    moved = pd.step(theta_hat, signals, 0.02)
    np.testing.assert_allclose(moved, theta_hat + 0.02 * dtheta_hat, rtol=1e-12, atol=1e-12)
