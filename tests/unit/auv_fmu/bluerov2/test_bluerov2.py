"""The BlueROV2 Heavy, against Fossen's matrices, another integrator, and mechanics."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal, Vector
from auv_fmu.bluerov2.bluerov2 import (
    Body,
    Hydrodynamics,
    Parameters,
    accelerations,
    advance,
    begin,
    rates,
)
from auv_fmu.bluerov2.thrusters import thrust
from auv_fmu.paper.attitude import (
    euler_from_rotation,
    quaternion_from_euler,
    rotation_from_euler,
    rotation_from_quaternion,
)
from auv_fmu.paper.plant import over_ground
from support import bluerov_oracle as oracle
from support.strategies import angles, vectors

PARAMETERS = Parameters()
IDLE, NONE_3, NONE_6 = Vector((0.0,) * 8), (0.0,) * 3, (0.0,) * 6
#: As heavy as the water that it displaces, which acts at its centre of mass.
NEUTRAL = Parameters(body=Body(volume=0.0135, r_b=NONE_3))

velocities = st.tuples(*(st.floats(-2.0, 2.0),) * 6)
wrenches = st.tuples(*(st.floats(-60.0, 60.0),) * 6)
streams = vectors(st.floats(-1.0, 1.0), 3)


def steps(parameters, state, command, water, dwater, h, n):
    """The state after n steps of h seconds, without a disturbance."""
    for k in range(n):
        rotation = rotation_from_quaternion(state.quaternion)
        now = tuple(w + k * h * a for w, a in zip(water, dwater, strict=True))
        state = advance(parameters, state, rotation, command, NONE_6, now, dwater, h)
    return state


@given(
    phi=angles, theta=st.floats(-1.5, 1.5), psi=angles, nu=velocities, tau=wrenches, tau_w=wrenches,
    water=streams, dwater=streams,
)  # fmt: skip
def test_accelerations_follow_from_fossens_matrices(phi, theta, psi, nu, tau, tau_w, water, dwater):
    """Over ground, in moving water: the body's momentum is over ground, the added one is not."""
    rotation = rotation_from_euler(phi, theta, psi)
    nu_r = over_ground(nu, rotation, tuple(-w for w in water))
    ours = np.array(accelerations(PARAMETERS, nu_r, rotation, tau, tau_w, dwater))
    R = oracle.rotation(np.array((phi, theta, psi)))
    ours[:3] += R.T @ np.array(dwater) - np.cross(nu[3:], R.T @ np.array(water))
    theirs = oracle.accelerations(
        np.array((phi, theta, psi)), np.array(nu), np.subtract(tau, tau_w),
        oracle.Water(np.array(water), np.array(dwater)),
    )  # fmt: skip
    assert ours == pytest.approx(theirs, rel=1e-12, abs=1e-12 * (1.0 + np.abs(theirs).max()))


#: Steady commands of manoeuvres. The horizontal thrusters are below the centre of mass, so those
#: ahead need the vertical ones against a pitch to the pole of Euler angles, which the other has.
MANOEUVRES = {
    "ahead": (0.3, 0.3, -0.3, -0.3, -0.17, -0.17, 0.155, 0.155),
    "aside": (-0.3, 0.3, 0.3, -0.3, 0.0, 0.0, 0.0, 0.0),
    "up": (0.0, 0.0, 0.0, 0.0, 0.4, 0.4, 0.4, 0.4),
    "turn": (-0.2, 0.2, 0.2, -0.2, 0.0, 0.0, 0.0, 0.0),
    "all": (0.1, 0.5, -0.4, -0.2, 0.1, 0.12, 0.09, 0.15),
}


@pytest.mark.parametrize("name", MANOEUVRES)
def test_open_loop_responses_agree_with_another_integrator(name):
    """Posture within 1 mm (mrad) in steps of 0.5 ms, within 5 cm (50 mrad) in steps of 20 ms.

    Euler's scheme is of first order: steps that are half as long halve the error.
    """
    command, times = Vector(MANOEUVRES[name]), np.linspace(0.0, 8.0, 9)
    steady = np.array([thrust(PARAMETERS.curve, c) for c in command])
    theirs = oracle.response(lambda t: steady, times, PARAMETERS.T)
    errors = {}
    for h in (0.02, 0.001, 0.0005):
        state, rows = begin(PARAMETERS, NONE_3), []
        for _ in times:
            rotation = rotation_from_quaternion(state.quaternion)
            rows.append((*state.position, *euler_from_rotation(rotation), *state.nu_r))
            state = steps(PARAMETERS, state, command, NONE_3, NONE_3, h, round(1.0 / h))
        gap = np.array(rows) - theirs
        gap[:, 3:6] = np.arctan2(np.sin(gap[:, 3:6]), np.cos(gap[:, 3:6]))
        errors[h] = np.abs(gap[:, :6]).max()
    assert errors[0.0005] < 1e-3
    assert errors[0.02] < 0.05
    assert errors[0.001] == pytest.approx(2.0 * errors[0.0005], rel=0.1)


# Mechanics


def settled(parameters, command, seconds):
    """The state after a time with held commands."""
    return steps(parameters, begin(parameters, NONE_3), command, NONE_3, NONE_3, 0.02,
                 round(seconds / 0.02))  # fmt: skip


def terminal(linear, quadratic, force):
    """The speed at which drag equals a force [m/s]."""
    return (-linear + sqrt(linear**2 + 4.0 * quadratic * force)) / (2.0 * quadratic)


@pytest.mark.parametrize("rho", [1000.0, 1025.0])
def test_without_thrust_the_vehicle_sinks_or_rises_at_its_terminal_speed(rho):
    """0.10 kg too heavy in fresh water, 0.23 kg too light in the sea."""
    state = settled(Parameters(body=Body(rho=rho)), IDLE, 30.0)
    net = 9.82 * (13.5 - rho * 0.0134)
    expected = np.sign(net) * terminal(33.0, 190.0, abs(net))
    assert state.nu_r == pytest.approx((0.0, 0.0, expected, 0.0, 0.0, 0.0), abs=1e-9)
    assert expected == pytest.approx({1000.0: 0.0259, 1025.0: -0.0535}[rho], abs=1e-4)


@pytest.mark.parametrize(
    ("k", "force", "linear", "quadratic"),
    [(0, 12.0, 13.7, 141.0), (1, 12.0, 0.0, 217.0), (2, 12.0, 33.0, 190.0), (5, 0.8, 0.0, 1.5)],
)
def test_steady_speeds_are_those_at_which_drag_is_the_thrust(k, force, linear, quadratic):
    """With held thrusts in one direction, from the oracle's geometry, of a neutral vehicle."""
    tau = np.zeros(6)
    tau[k] = force
    thrusts = Vector(np.linalg.pinv(oracle.effect()) @ tau)
    held = Parameters(body=Body(volume=0.0135), T=1e12)
    state = begin(held, NONE_3)._replace(thrust=thrusts)
    state = steps(held, state, IDLE, NONE_3, NONE_3, 0.02, 1500)
    expected = np.zeros(6)
    expected[k] = terminal(linear, quadratic, force)
    assert state.nu_r == pytest.approx(tuple(expected), abs=1e-6)


def test_weight_below_buoyancy_rights_the_vehicle_as_a_pendulum():
    """Small oscillations of roll, without damping: omega^2 = B z_b / (I_x + K_dp)."""
    still = Hydrodynamics(linear=NONE_6, quadratic=NONE_6)
    calm = Parameters(body=Body(volume=0.0135), hydrodynamics=still,
                      eta0=(0.0, 0.0, 0.0, 0.01, 0.0, 0.0))  # fmt: skip
    omega = sqrt(13.5 * 9.82 * 0.01 / (0.26 + 0.189))
    quarter = np.pi / 2.0 / omega
    n = 20000
    state = steps(calm, begin(calm, NONE_3), IDLE, NONE_3, NONE_3, quarter / n, n)
    roll, pitch, _ = euler_from_rotation(rotation_from_quaternion(state.quaternion))
    assert (roll, pitch) == pytest.approx((0.0, 0.0), abs=2e-6)
    assert state.nu_r[3] == pytest.approx(-0.01 * omega, rel=1e-3)


@given(water=streams, command=st.tuples(*(st.floats(-0.5, 0.5),) * 8))
def test_a_constant_current_carries_the_vehicle_along_and_changes_nothing_else(water, command):
    """So the motion is that in still water, seen from a frame that drifts."""
    drifting = PARAMETERS._replace(nu0=(*water, 0.0, 0.0, 0.0))
    moved = steps(drifting, begin(drifting, water), Vector(command), water, NONE_3, 0.02, 50)
    still = steps(PARAMETERS, begin(PARAMETERS, NONE_3), Vector(command), NONE_3, NONE_3, 0.02, 50)
    assert moved.nu_r == pytest.approx(still.nu_r, abs=1e-12)
    assert moved.quaternion == pytest.approx(still.quaternion, abs=1e-12)
    assert np.subtract(moved.position, still.position) == pytest.approx(water, abs=1e-12)


@given(dwater=streams)
def test_accelerating_water_carries_a_neutral_vehicle_like_itself(dwater):
    state = steps(NEUTRAL, begin(NEUTRAL, NONE_3), IDLE, NONE_3, dwater, 0.02, 50)
    assert state.nu_r == pytest.approx(NONE_6, abs=1e-12)
    assert state.position == pytest.approx(tuple(0.5 * a for a in dwater), abs=1e-12)


def test_accelerating_water_pushes_a_light_vehicle_further_than_itself():
    """A volume without mass: (m_w - m) a of the water less than its added mass."""
    empty = Parameters(body=Body(mass=1e-6, r_b=NONE_3, gravity=0.0))
    rotation = rotation_from_euler(0.0, 0.0, 0.0)
    du = accelerations(empty, NONE_6, rotation, NONE_6, NONE_6, (1.0, 0.0, 0.0))[0]
    assert du == pytest.approx(13.4 / 6.36, rel=1e-5)


def test_a_vertical_vehicle_has_an_attitude_like_any_other():
    """A pitch of 90 degrees is not a pole, and the vehicle comes back from it."""
    nose_up = Parameters(eta0=(0.0, 0.0, 0.0, 0.0, np.pi / 2.0, 0.0))
    state = steps(nose_up, begin(nose_up, NONE_3), IDLE, NONE_3, NONE_3, 0.02, 3000)
    euler = euler_from_rotation(rotation_from_quaternion(state.quaternion))
    assert euler == pytest.approx(NONE_3, abs=0.01)


def test_thrust_follows_with_its_time_constant_and_the_step_has_its_mean():
    lagging, command = PARAMETERS._replace(T=0.5), Vector((0.0,) * 7 + (1.0,))
    full = thrust(PARAMETERS.curve, 1.0)
    state = steps(lagging, begin(lagging, NONE_3), command, NONE_3, NONE_3, 0.02, 25)
    assert state.thrust == pytest.approx((0.0,) * 7 + (full * (1.0 - np.exp(-1.0)),))
    once = steps(lagging, begin(lagging, NONE_3), command, NONE_3, NONE_3, 1e-3, 1)
    x = 1e-3 / 0.5
    heave = -full * (1.0 - (1.0 - np.exp(-x)) / x) + 9.82 * 0.1
    assert once.nu_r[2] == pytest.approx(1e-3 * heave / (13.5 + 18.68), rel=1e-9)


@given(
    nu=velocities, thrusts=st.tuples(*(st.floats(-39.0, 50.0),) * 8), water=streams, dwater=streams,
    phi=angles, theta=st.floats(-1.4, 1.4),
)  # fmt: skip
def test_rates_agree_with_small_steps(nu, thrusts, water, dwater, phi, theta):
    """For solvers of their own, in water that moves, and whose velocity has jumped."""
    state = begin(PARAMETERS, NONE_3)._replace(
        quaternion=quaternion_from_euler(phi, theta, 0.3), nu_r=nu, thrust=Vector(thrusts)
    )
    rotation, command = rotation_from_quaternion(state.quaternion), Vector((0.3,) * 8)
    rate = rates(PARAMETERS, state, rotation, command, NONE_6, water, dwater)
    h = 1e-7
    later = advance(PARAMETERS, state, rotation, command, NONE_6, water, dwater, h)
    scale = 1.0 + np.abs(nu).max() ** 2 + np.abs(thrusts).max()
    assert np.subtract(later.thrust, state.thrust) / h == pytest.approx(
        np.array(rate.thrust), rel=1e-5, abs=1e-4
    )
    assert np.subtract(later.position, state.position) / h == pytest.approx(
        rate.position, abs=1e-5 * scale
    )
    # Over ground, because the two states are in different water.
    after = over_ground(later.nu_r, rotation_from_quaternion(later.quaternion), later.water)
    as_now = over_ground(state.nu_r, rotation, state.water)
    ground = (np.array(after) - as_now) / h
    omega, R = nu[3:], np.array(rotation).T
    expected = np.array(rate.nu_r)
    expected[:3] += R.T @ dwater - np.cross(omega, R.T @ state.water)
    assert ground == pytest.approx(expected, abs=1e-4 * scale)


def test_motions_beyond_the_model_are_refused():
    state = begin(PARAMETERS, NONE_3)
    with pytest.raises(Refusal, match=r"1e\+30 m/s"):
        steps(PARAMETERS, state, IDLE, (1e30, 0.0, 0.0), NONE_3, 0.02, 1)
    with pytest.raises(Refusal, match="5 m/s and 20 rad/s"):
        begin(PARAMETERS, (0.0, 6.0, 0.0))
    with pytest.raises(Refusal, match="rad/s"):
        rates(PARAMETERS, state._replace(nu_r=(0.0, 0.0, 0.0, 21.0, 0.0, 0.0)),
              rotation_from_quaternion(state.quaternion), IDLE, NONE_6, NONE_3, NONE_3)  # fmt: skip


@given(nu=st.tuples(*(st.floats(-2.8, 2.8),) * 3, *(st.floats(-11.0, 11.0),) * 3))
def test_from_any_motion_within_the_model_steps_continue(nu):
    """2.8 of each of three makes 4.9, and 11 makes 19."""
    moving = PARAMETERS._replace(nu0=nu)
    steps(moving, begin(moving, NONE_3), IDLE, NONE_3, NONE_3, 0.02, 25)
