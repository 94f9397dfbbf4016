"""(22), the bound of (21), and Lemma 2."""

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.adaptation import NU, bound, regressor, robust_force, theta_hat_rate
from support.strategies import speeds, vectors

three = vectors(speeds, 3)
numbers = st.floats(-50.0, 50.0)
positive = st.floats(0.01, 20.0)


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


@given(rho=st.floats(0, 1e3), r=three, eps_t=st.floats(0.01, 10))
def test_robust_force_opposes_the_error_and_is_bounded_by_rho(rho, r, eps_t):
    for force_i, r_i in zip(robust_force(rho, r, eps_t), r, strict=True):
        assert abs(force_i) <= rho
        assert force_i * r_i >= 0.0


def test_constant_of_lemma_2_has_the_digits_it_is_printed_with():
    assert exp(-(NU + 1)) == pytest.approx(NU, abs=5e-5)


@given(x=vectors(numbers, 3), h=numbers, eps_t=positive)
def test_lemma_2(x, h, eps_t):
    """h |x| - x' h Tanh(nu h x / eps_t) <= n eps_t, checked in the norm that makes it true.

    The lemma holds component by component, |h x_i| - h x_i tanh(nu h x_i / eps_t) <= eps_t, and
    the Euclidean norm is not larger than the sum of the components.
    """
    slack = 1e-3 * eps_t  # nu has four digits
    force = robust_force(h, x, eps_t)
    for x_i, force_i in zip(x, force, strict=True):
        assert abs(h * x_i) - x_i * force_i <= eps_t + slack
    assert h * np.linalg.norm(x) - np.dot(x, force) <= 3 * eps_t + 3 * slack
