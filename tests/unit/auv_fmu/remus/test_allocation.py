"""Fins and propeller from force and moments: the inverse of the vehicle's own tail."""

from math import isfinite, pi, radians, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.remus.allocation import Parameters, allocate, evaluate
from auv_fmu.remus.tail import Tail, forces, limit_tail

TAIL = Tail()
MEASURED = Parameters(measured=True)
MOST, FASTEST_TURNING = radians(15.0), 1525 * pi / 30
angles = st.floats(-MOST, MOST)
velocities = st.tuples(st.floats(0.3, 2.5), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
wild = st.floats(allow_nan=False, allow_infinity=False)


def given_by(command, nu_r):
    u, v, w = nu_r
    x, _, _, _, m, n = forces(TAIL, command, u, v, w, sqrt(u * u + v * v + w * w))
    return x, m, n


@given(delta_r=angles, delta_s=angles, n=st.floats(60.0, FASTEST_TURNING), nu_r=velocities)
def test_it_inverts_the_tail_within_the_limits(delta_r, delta_s, n, nu_r):
    """Force and moments of the tail, ahead of the propeller's least thrust, are given back."""
    wanted = given_by((delta_r, delta_s, n), nu_r)
    command, attained = evaluate(MEASURED, wanted, nu_r)
    assert command[:2] == pytest.approx((delta_r, delta_s), abs=1e-9)
    assert attained == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    assert given_by(command, nu_r) == attained


@given(n=st.floats(-FASTEST_TURNING, FASTEST_TURNING), nu_r=velocities)
def test_every_thrust_of_the_propeller_can_be_attained(n, nu_r):
    """Several speeds of the propeller give the same thrust; any of them will do."""
    wanted = given_by((0.0, 0.0, n), nu_r)
    _, attained = evaluate(MEASURED, wanted, nu_r)
    assert attained == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@given(tau=st.tuples(wild, wild, wild), nu_r=st.tuples(wild, wild, wild), measured=st.booleans())
def test_commands_are_within_their_limits_and_attained_is_what_they_give(tau, nu_r, measured):
    command, attained = evaluate(Parameters(measured=measured), tau, nu_r)
    assert command == limit_tail(TAIL, command)
    assert all(map(isfinite, (*command, *attained)))


@given(k=st.floats(1.0, 1e6), nu_r=velocities)
def test_a_moment_beyond_the_limit_takes_the_fin_to_it(k, nu_r):
    most = given_by((MOST, MOST, 0.0), nu_r)
    command, attained = evaluate(MEASURED, (0.0, k * most[1], k * most[2]), nu_r)
    assert command[:2] == pytest.approx((MOST, MOST))
    assert attained[1:] == pytest.approx(most[1:])


def test_a_force_beyond_the_limit_takes_the_propeller_to_it():
    for sign in (1.0, -1.0):
        (_, _, n), _ = evaluate(MEASURED, (sign * 1e4, 0.0, 0.0), (1.5, 0.0, 0.0))
        assert n == pytest.approx(sign * FASTEST_TURNING)


@pytest.mark.parametrize("moment", [-3.0, -1e-300, 1e-300, 3.0])
def test_without_flow_fins_go_to_their_limits_and_give_nothing(moment):
    command, attained = evaluate(MEASURED, (0.0, moment, moment), (0.0, 0.0, 0.0))
    sign = 1.0 if moment > 0.0 else -1.0
    assert command == (sign * MOST, -sign * MOST, 0.0)
    assert attained == (0.0, 0.0, 0.0)


def test_nothing_is_nothing():
    assert evaluate(MEASURED, (0.0,) * 3, (0.0,) * 3).command == (0.0, 0.0, 0.0)


@given(nu_r=velocities, tau=st.tuples(*(st.floats(-20.0, 20.0),) * 3))
def test_the_nominal_speed_is_used_unless_the_speed_is_measured(nu_r, tau):
    nominal = Parameters(speed=1.2)
    assert evaluate(nominal, tau, nu_r) == allocate(TAIL, tau, 1.2, 0.0, 0.0)
    assert evaluate(MEASURED, tau, nu_r) == allocate(TAIL, tau, *nu_r)


@given(ratio=st.floats(0.5, 1.6))
def test_at_another_speed_than_the_nominal_one_moments_go_with_its_square(ratio):
    command, attained = evaluate(Parameters(speed=1.5), (0.0, 0.5, 0.5), (0.0, 0.0, 0.0))
    _, pitch, yaw = given_by(command, (ratio * 1.5, 0.0, 0.0))
    assert (pitch, yaw) == pytest.approx((ratio**2 * 0.5, ratio**2 * 0.5))
    assert attained[1:] == pytest.approx((0.5, 0.5))
