"""(18), (23), (24) and (51): the velocity observer."""

from math import exp, expm1

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper import observer, output_feedback
from auv_fmu.paper.observer import Form
from auv_fmu.paper.output_feedback import ControllerState, Gains, Measurement
from auv_fmu.paper.saturation import Saturation, saturation
from support.strategies import speeds, vectors

three = vectors(speeds, 3)

ORIGIN = (0.0, 0.0, 0.0)


def estimate(dy_hat_o, z, lambda_, k_d, form=Form.EULER, h=0.02):
    """dy_hat of (23), of a controller that finds y = z where y_hat = 0."""
    gains = Gains(lambda_=lambda_, k_d=k_d, form=form)
    measured = Measurement(z, ORIGIN, ORIGIN, ORIGIN, ORIGIN)
    state = ControllerState(ORIGIN, dy_hat_o, (0.0,) * 4, 0.0)
    return output_feedback.evaluate(gains, state, measured, h).dy_hat


def s(z):
    return saturation(Saturation.TANH, z)


def test_observer_finds_a_constant_velocity():
    """With ddy_r = 0 its error obeys dz = -(k_d + lambda) z around rest: it dies out as exp."""
    lambda_, k_d, h = 1.0, 50.0, 1e-4
    dy = dy_hat_o = (0.4, -0.2, 0.1)
    z_0 = np.array([1e-3, -2e-3, 5e-4])
    y_hat, y = np.zeros(3), z_0
    for _ in range(1000):
        z = y - y_hat
        rate = estimate(dy_hat_o, z, lambda_, k_d)
        y_hat, y = y_hat + h * np.array(rate), y + h * np.array(dy)
    np.testing.assert_allclose(y - y_hat, z_0 * exp(-(k_d + lambda_) * 0.1), rtol=0.02)
    assert estimate(dy_hat_o, ORIGIN, lambda_, k_d) == dy


@given(z=three, lambda_=speeds, k_d=st.floats(0, 100))
def test_first_velocity_estimate_is_zero(z, lambda_, k_d):
    """The initial condition below (24) makes dy_hat(0) = 0."""
    dy_hat_o = observer.initial_dy_hat_o(s(z), z, lambda_, k_d)
    first = estimate(dy_hat_o, z, lambda_, k_d)
    assert first == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


@given(y=three, y_hat=three, dy=three, dy_hat_o=three, ddy_r=three)
def test_observer_is_the_one_of_the_proof(y, y_hat, dy, dy_hat_o, ddy_r):
    """(18), (23) and (24) "are equivalent to" d/dt (r_1 - r_2) = k_d r_2, above (28).

    r_1 - r_2 = dy_o - dy_r. Its rate is a central difference along y, y_hat and dy_hat_o as they
    move; only with dy_o of (18), not with the state dy_hat_o in its place, is it k_d r_2.
    """
    lambda_, k_d, h = 0.7, 50.0, 1e-6
    y, y_hat, dy, dy_hat_o, ddy_r = map(np.array, (y, y_hat, dy, dy_hat_o, ddy_r))
    z = y - y_hat
    dy_hat = np.array(estimate(dy_hat_o, z, lambda_, k_d))
    ddy_hat_o = np.array(observer.rate(Form.EULER, ddy_r, s(z), lambda_, k_d))

    def dy_o(t):
        z = y + t * dy - (y_hat + t * dy_hat)
        moved = estimate(dy_hat_o + t * ddy_hat_o, z, lambda_, k_d)
        return np.array(moved) - lambda_ * np.array(s(z))

    rate = (dy_o(h) - dy_o(-h)) / (2 * h) - ddy_r
    np.testing.assert_allclose(rate, k_d * (dy - dy_o(0.0)), rtol=1e-6, atol=1e-4)


def test_24_starts_from_dy_r():
    """At t = 0 the integral in (24) is empty: what is left is dy_r, and not zero as printed below.

    Fig. 4 at its start: a reference at rest, and a control point that is 6.6 m away.
    """
    gains, y = Gains(form=Form.INTEGRAL), (2.35, 6.0, 0.0)
    state = output_feedback.initial_state(gains, y)
    measured = Measurement(y, ORIGIN, (0.35, 0.0, -2.0), ORIGIN, ORIGIN)
    dy_r = output_feedback.evaluate(gains, state, measured, 0.02).dy_hat
    assert state.dy_hat_o == ORIGIN
    np.testing.assert_allclose(dy_r, -np.tanh([2.0, 6.0, 2.0]))


def test_state_of_the_observer_is_equation_24():
    """dy_hat_o = dy_r + k_d Lambda int s(z), up to its initial value (reading 4).

    Along s(z) = 0.9 cos(w t) and dy_r = sin(w t) the integral is known; that of (51) is taken by
    the midpoint rule.
    """
    lambda_, k_d, end, n = 2.0, 50.0, 3.0, 3000
    w, h = np.array([0.5, 1.0, 2.0]), end / n
    integral = np.zeros(3)
    for t in (np.arange(n) + 0.5) * h:
        z = np.arctanh(0.9 * np.cos(w * t))
        integral += h * np.array(observer.rate(Form.EULER, w * np.cos(w * t), s(z), lambda_, k_d))
    expected = np.sin(w * end) + k_d * lambda_ * 0.9 * np.sin(w * end) / w
    np.testing.assert_allclose(integral, expected, rtol=1e-6)


@given(k_d=st.floats(0.1, 1e4), h=st.floats(1e-4, 1.0), z=vectors(st.floats(-1e-3, 1e-3), 3))
def test_exact_gain_takes_the_error_where_the_continuous_observer_takes_it(k_d, h, z):
    """dz/dt = -k_d z, with a vehicle that moves on as dy_hat_o says: exp(-k_d h) z in any step."""
    dy = (0.4, -0.2, 0.1)
    rate = estimate(dy, z, 0.0, k_d, Form.EXACT, h)
    after = np.array(z) + h * np.array(dy) - h * np.array(rate)
    np.testing.assert_allclose(after, np.array(z) * exp(-k_d * h), rtol=1e-9, atol=1e-15)


@given(k_d=st.floats(0.1, 1e3), h=st.floats(1e-4, 0.1))
def test_exact_gain_is_the_mean_of_a_gain_that_decays(k_d, h):
    """By the midpoint rule; it is k_d for small steps, and below 1 / h for all."""
    n = 2000
    t = (np.arange(n) + 0.5) * h / n
    gain = observer.exact_gain(k_d, h)
    assert gain == pytest.approx(np.mean(k_d * np.exp(-k_d * t)), rel=1e-3)
    assert gain <= min(k_d, 1.0 / h) * (1 + 1e-12)
    assert observer.exact_gain(k_d, 1e-12) == pytest.approx(k_d, rel=1e-8)


def test_holding_the_measurement_instead_shows_another_velocity():
    """The exact solution under a held y, for y = v t: dy_hat settles at k_d h / (1 - exp) v."""
    k_d, h, v = 50.0, 0.02, 0.4
    y_hat, shown = 0.0, 0.0
    for k in range(100):
        shown = k_d * (k * h * v - y_hat)
        y_hat -= shown * expm1(-k_d * h) / k_d
    assert shown == pytest.approx(v * k_d * h / -expm1(-k_d * h), rel=1e-9)
    assert shown / v == pytest.approx(1.58, abs=0.005)
