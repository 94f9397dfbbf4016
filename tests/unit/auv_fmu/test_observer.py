"""(18), (23), (24) and (51): the velocity observer, one axis."""

from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.observer import (
    initial_dy_hat_o,
    observer_acceleration,
    observer_velocity,
    velocity_estimate,
)
from auv_fmu.saturation import hyperbolic_tangent
from support.strategies import speeds


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
