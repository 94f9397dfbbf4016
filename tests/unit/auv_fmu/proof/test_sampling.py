"""The rates that the step must follow, against matrices and against Euler's scheme itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import output_feedback
from auv_fmu.adaptation import robust_force
from auv_fmu.output_feedback import ControllerState, Gains, Measurement
from auv_fmu.proof.sampling import observer_rate, robust_rate

ORIGIN = (0.0, 0.0, 0.0)


@given(lambda_=st.floats(0.1, 5.0), k_d=st.floats(1.0, 500.0))
def test_observer_rate_is_an_eigenvalue_of_its_linearisation(lambda_, k_d):
    """States z and dy_hat_o of an axis: (50) with y at rest, (51) with Remark 3."""
    dy_hat = np.array([lambda_ + k_d, 1.0])
    A = np.array([-dy_hat, -lambda_ * dy_hat + [k_d * lambda_, 0.0]])
    assert observer_rate(lambda_, k_d) == pytest.approx(-np.linalg.eigvals(A).real.min())


@pytest.mark.parametrize(("k_d", "grows"), [(95.0, False), (101.0, True)])
def test_observer_is_unstable_where_a_step_is_longer_than_2_over_its_rate(k_d, grows):
    """The controller's own observer, vehicle and reference at rest, z(0) = 1e-9 m, h = 20 ms."""
    gains, h = Gains(k_d=k_d, theta_0=(0.0,) * 4), 0.02
    assert (h * observer_rate(gains.lambda_, k_d) > 2.0) is grows
    state = ControllerState((1e-9, 0.0, 0.0), ORIGIN, gains.theta_0)
    measurement = Measurement(ORIGIN, ORIGIN, ORIGIN, ORIGIN, ORIGIN)
    for _ in range(500):
        signals = output_feedback.evaluate(gains, state, measurement, h)
        state = output_feedback.step(state, signals, h)
    assert (abs(state.y_hat[0]) > 1e-9) is grows


@given(rho_hat=st.floats(1.0, 100.0), eps_t=st.floats(0.1, 10.0))
def test_robust_rate_is_the_slope_of_the_robust_term_over_the_inertia(rho_hat, eps_t):
    r = 1e-6 * eps_t / rho_hat
    force, *_ = robust_force(rho_hat, (r, 0.0, 0.0), eps_t)
    assert robust_rate(rho_hat, eps_t, 25.0) == pytest.approx(force / r / 25.0, rel=1e-6)
