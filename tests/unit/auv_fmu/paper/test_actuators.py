"""(3), and actuators that take their time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.actuators import drive, limit, limit_all, mean_response, respond
from support.strategies import forces, vectors


@given(tau=forces, limits=vectors(forces, 2))
def test_actuator_stays_within_its_limits_and_is_linear_between_them(tau, limits):
    tau_min, tau_max = sorted(limits)
    limited = limit(tau, tau_min, tau_max)
    assert tau_min <= limited <= tau_max
    assert limited == tau or tau != np.clip(tau, tau_min, tau_max)


def test_limits_of_each_actuator_are_its_own():
    tau_min, tau_max = (-1.0, -2.0, -3.0), (1.0, 2.0, 3.0)
    assert limit_all((9.0, 9.0, 9.0), tau_min, tau_max) == tau_max
    assert limit_all((-9.0, -9.0, -9.0), tau_min, tau_max) == tau_min
    assert limit_all((0.5, -0.5, 2.5), tau_min, tau_max) == (0.5, -0.5, 2.5)


@given(before=forces, tau=forces, T=st.floats(1e-3, 10.0), h=st.floats(1e-4, 1.0))
def test_actuator_follows_its_equation_however_time_is_split(before, tau, T, h):
    """T dtau_a/dt = tau - tau_a: its rate at the end, and two half steps for a whole one."""
    after = respond(before, tau, T, h)
    half = respond(respond(before, tau, T, h / 2), tau, T, h / 2)
    assert after == pytest.approx(half, rel=1e-12, abs=1e-12)
    small = 1e-4 * T
    rate = (respond(after, tau, T, small) - after) / small
    assert T * rate == pytest.approx(tau - after, rel=1e-4, abs=1e-9)


@given(before=forces, tau=forces, T=st.floats(0.0, 1.7e308))
def test_no_time_constant_is_too_small_or_too_large(before, tau, T):
    low, high = min(before, tau), max(before, tau)
    assert low - 1e-12 <= respond(before, tau, T, 0.02) <= high + 1e-12
    assert respond(before, tau, 5e-324, 0.02) == respond(before, tau, 0.0, 0.02) == tau
    assert respond(before, tau, 1e300, 0.02) == pytest.approx(before, abs=1e-12)
    assert low - 1e-9 <= mean_response(before, tau, T, 0.02) <= high + 1e-9


@given(before=forces, tau=forces, T=st.floats(1e-3, 10.0), h=st.floats(1e-4, 1.0))
def test_mean_of_an_actuator_is_its_impulse(before, tau, T, h):
    """The equation says it: T (tau_a(h) - tau_a(0)) = h tau - integral of tau_a."""
    change = respond(before, tau, T, h) - before
    assert h * mean_response(before, tau, T, h) == pytest.approx(
        h * tau - T * change, rel=1e-9, abs=1e-9
    )


@given(before=vectors(forces, 3), tau=vectors(forces, 3), T=vectors(st.floats(0.0, 10.0), 3))
def test_actuators_of_a_step_have_the_mean_that_simpsons_rule_finds(before, tau, T):
    first, middle, last, mean = map(np.array, drive(before, tau, T, 0.02))
    scale = np.abs([before, tau]).max() + 1.0
    np.testing.assert_allclose((first + 4 * middle + last) / 6, mean, atol=1e-12 * scale)
    halfway = [respond(b, t, T_k, 0.01) for b, t, T_k in zip(before, tau, T, strict=True)]
    slow = np.array(T) > 0.2
    np.testing.assert_allclose(middle[slow], np.array(halfway)[slow], atol=1e-7 * scale)
