"""Fins and propeller of the REMUS 100."""

from math import pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.remus.tail import Tail, forces, limit_tail, propeller

TAIL = Tail()
speeds = st.floats(0.0, 3.0)


def test_thrust_at_rest_follows_from_its_coefficient():
    """rho D^4 KT n^2, with n in rev/s."""
    thrust, torque = propeller(TAIL, 1525.0 * pi / 30.0, 0.0)
    assert thrust == pytest.approx(1026 * 0.14**4 * 0.4566 * (1525 / 60) ** 2, rel=1e-12)
    assert torque == pytest.approx(1026 * 0.14**5 * 0.07 * (1525 / 60) ** 2, rel=1e-12)


def test_thrust_at_the_largest_speed_follows_from_the_other_coefficient():
    """The published advance number belongs to 2.5 m/s at 1525 rev/min."""
    thrust, torque = propeller(TAIL, 1525.0 * pi / 30.0, 2.5)
    scale = 1026 * 0.14**4 * (1525 / 60) ** 2
    assert thrust == pytest.approx(scale * 0.1798, rel=1e-4)
    assert torque == pytest.approx(scale * 0.14 * 0.0312, rel=1e-4)


@given(n=st.floats(0.0, 160.0), speed=speeds)
def test_reverse_thrust_does_not_depend_on_the_speed(n, speed):
    forward, _ = propeller(TAIL, n, 0.0)
    backward, _ = propeller(TAIL, -n, speed)
    assert backward == pytest.approx(-forward)


@given(delta=st.floats(-0.26, 0.26), u=speeds, across=st.floats(-1.0, 1.0))
def test_rudder_and_stern_planes_turn_the_vehicle_as_they_are_said_to(delta, u, across):
    """To starboard and nose down for positive angles, 0.8 m from the centre, as 1/2 rho V^2 A C."""
    force, q = 0.5 * 1026 * (u * u + across * across) * 0.0133 * delta, 0.8
    _, sway, _, _, pitch, yaw = forces(TAIL, (delta, 0.0, 0.0), u, across, 0.0, u)
    assert (sway, pitch, yaw) == pytest.approx((-0.5 * force, 0.0, q * 0.5 * force), abs=1e-12)
    _, sway, heave, _, pitch, yaw = forces(TAIL, (0.0, delta, 0.0), u, 0.0, across, u)
    assert (sway, heave, yaw) == pytest.approx((0.0, -0.7 * force, 0.0), abs=1e-12)
    assert pitch == pytest.approx(-q * 0.7 * force, abs=1e-12)


@given(u=speeds, delta_r=st.floats(-0.26, 0.26), delta_s=st.floats(-0.26, 0.26))
def test_fins_only_brake(u, delta_r, delta_s):
    assert forces(TAIL, (delta_r, delta_s, 0.0), u, 0.0, 0.0, u)[0] <= 0.0


def test_limits():
    most = radians(15.0), radians(15.0), 1525 * pi / 30
    assert limit_tail(TAIL, (1.0, 9.0, 1e3)) == pytest.approx(most, rel=1e-15)
    assert limit_tail(TAIL, (-1.0, -9.0, -1e3)) == pytest.approx([-x for x in most], rel=1e-15)
    assert limit_tail(TAIL, (0.1, -0.2, 30.0)) == (0.1, -0.2, 30.0)
