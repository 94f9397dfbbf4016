"""The plant: (1) and (2) with six degrees of freedom."""

from itertools import pairwise
from math import cos, exp, expm1, sin
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from auv_fmu.paper import plant
from auv_fmu.paper.attitude import rotation_from_euler, rotation_from_quaternion
from auv_fmu.paper.plant import Integrator, Parameters, RollAxis
from auv_fmu.paper.vehicle import Vehicle, accelerations, euler_rates
from support.strategies import angles, forces, pitch_angles, speeds, vectors

#: Section 4.1 has m44 = m55, which could hide terms of roll.
VEHICLE, ROLL = Vehicle(), RollAxis(m44=12.5, d44=18.0)
MASSES = np.array([VEHICLE.m11, VEHICLE.m22, VEHICLE.m33, ROLL.m44, VEHICLE.m55, VEHICLE.m66])
DAMPING = np.array([VEHICLE.d11, VEHICLE.d22, VEHICLE.d33, ROLL.d44, VEHICLE.d55, VEHICLE.d66])
AT_REST = (0.0,) * 6
UNDRIVEN = (0.0,) * 3
PARAMETERS = Parameters(VEHICLE, ROLL)


@given(nu=vectors(speeds, 6), euler=vectors(angles, 3))
def test_undriven_plant_loses_energy_only_to_damping(nu, euler):
    """d/dt (nu' M nu / 2 + U) = -nu' D nu with U = -G cos(theta) cos(phi), for equal G."""
    G = VEHICLE.righting_pitch
    phi, theta, _ = euler
    rotation = rotation_from_euler(*euler)
    acceleration = plant.accelerations_6dof(VEHICLE, ROLL, nu, rotation, UNDRIVEN, AT_REST)
    _, _, _, p, q, r = nu
    # d/dt (cos(theta) cos(phi)) = d/dt R33 for a body that turns at (p, q, r).
    r33_rate = p * -cos(theta) * sin(phi) + q * -sin(theta)
    power = np.dot(MASSES * nu, acceleration) - G * r33_rate
    np.testing.assert_allclose(power, -np.dot(DAMPING * nu, nu), rtol=1e-10, atol=1e-9)


@given(
    nu=vectors(speeds, 5),
    theta=pitch_angles,
    psi=angles,
    tau=vectors(forces, 3),
    tau_w=vectors(speeds, 5),
)
def test_plant_without_roll_is_equation_2(nu, theta, psi, tau, tau_w):
    u, v, w, q, r = nu
    a, b, c, d, e = tau_w
    six = plant.accelerations_6dof(
        VEHICLE,
        ROLL,
        (u, v, w, 0.0, q, r),
        rotation_from_euler(0.0, theta, psi),
        tau,
        (a, b, c, 0.0, d, e),
    )
    five = accelerations(VEHICLE, nu, sin(theta), tau, tau_w)
    assert (*six[:3], *six[4:]) == five


@given(tau_w=vectors(forces, 6))
def test_disturbance_pushes_a_vehicle_at_rest_backwards_in_every_direction(tau_w):
    level = rotation_from_euler(0.0, 0.0, 0.0)
    actual = plant.accelerations_6dof(VEHICLE, ROLL, AT_REST, level, UNDRIVEN, tau_w)
    np.testing.assert_allclose(actual, -np.array(tau_w) / MASSES, rtol=1e-14)


@given(nu=vectors(speeds, 6), euler=vectors(angles, 3))
def test_coriolis_terms_follow_from_a_diagonal_mass_matrix(nu, euler):
    """M dnu/dt + C(nu) nu + D nu + g = 0, with C from the cross products of Kirchhoff."""
    M = np.diag(MASSES)
    momentum = M @ np.array(nu)
    linear, angular = np.array(nu[:3]), np.array(nu[3:])
    coriolis = np.concatenate(
        [
            np.cross(angular, momentum[:3]),
            np.cross(linear, momentum[:3]) + np.cross(angular, momentum[3:]),
        ]
    )
    phi, theta, _ = euler
    restoring = np.array(
        [
            0,
            0,
            0,
            sin(phi) * cos(theta) * ROLL.righting_roll,
            sin(theta) * VEHICLE.righting_pitch,
            0,
        ]
    )
    expected = np.linalg.solve(M, -coriolis - DAMPING * nu - restoring)
    rotation = rotation_from_euler(*euler)
    actual = plant.accelerations_6dof(VEHICLE, ROLL, nu, rotation, UNDRIVEN, AT_REST)
    np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=1e-12)


def started(eta0, nu0, parameters=PARAMETERS):
    return plant.begin(parameters._replace(eta0=eta0, nu0=nu0), parameters.current)


def moved(state, tau, tau_w, h, parameters=PARAMETERS, n=1, dwater=(0.0, 0.0, 0.0)):
    return swept(state, parameters, n, h, lambda t: (parameters.current, dwater), tau, tau_w)


def seen(state, parameters=PARAMETERS):
    rotation = rotation_from_quaternion(state.quaternion)
    return plant.outputs(state, rotation, parameters.ell, parameters.roll.rolls)


def test_surge_under_constant_force_follows_the_analytic_solution_of_euler():
    """u_k = tau/d (1 - (1 - h d/m)^k) when nothing turns."""
    h, tau_u, n = 0.02, 10.0, 500
    state = started((0.0,) * 6, AT_REST)
    for _ in range(n):
        state = moved(state, (tau_u, 0.0, 0.0), AT_REST, h)
    expected = tau_u / VEHICLE.d11 * (1 - (1 - h * VEHICLE.d11 / VEHICLE.m11) ** n)
    assert state.nu_r[0] == pytest.approx(expected, rel=1e-12)
    assert state.nu_r[1:] == (0.0,) * 5


def test_vehicle_that_passes_the_vertical_keeps_a_unit_quaternion_and_does_not_jump():
    state = started((0.0, 0.0, 0.0, 0.0, 1.3, 0.2), (1.0, 0.0, 0.0, 0.01, 0.9, 0.01))
    steepest, largest_move = 0.0, 0.0
    for _ in range(200):
        before = seen(state)
        state = moved(state, (5.0, 6.0, 0.0), AT_REST, 0.02)
        after = seen(state)
        assert np.linalg.norm(state.quaternion) == pytest.approx(1.0, abs=1e-12)
        steepest = max(steepest, after.euler[1])
        largest_move = max(largest_move, float(np.abs(np.subtract(after.y, before.y)).max()))
    assert steepest > np.deg2rad(89)
    # At 1.3 m/s and 1 rad/s the control point moves less than 4 cm in 20 ms.
    assert largest_move < 0.04


def test_rates_are_newtons_in_water_that_moves_as_it_likes():
    """Against an integration of the velocity over ground in the earth frame.

    The water of the state follows the acceleration that is said, and the water moves otherwise.
    """
    said, tau, tau_w = (0.02, -0.01, 0.03), (20.0, 1.0, -2.0), (1.0, 0.0, -1.0, 0.2, 0.0, 0.1)
    lagging = PARAMETERS._replace(T=(0.7, 0.0, 2.0))
    first = started((1.0, 2.0, 3.0, 0.3, -0.2, 0.5), (0.5, 0.1, -0.1, 0.2, 0.1, 0.1), lagging)

    def water(t):
        return np.array((0.3 * sin(0.5 * t), 0.2 * cos(t) - 0.2, 0.1 * t))

    def rates(t, x):
        state = plant.PlantState(*(tuple(x[i:j]) for i, j in pairwise((0, 3, 7, 13, 16, 19))))
        rotation = rotation_from_quaternion(state.quaternion)
        rate = plant.state_rates(lagging, state, rotation, tau, tau_w, tuple(water(t)), said)
        return np.concatenate(rate)

    def earth_fixed(t, x):
        velocity, R, omega = x[3:6], x[6:15].reshape(3, 3), x[15:18]
        through = R.T @ (velocity - water(t))
        acting = (tau[0] * (1 - exp(-t / 0.7)), tau[1], tau[2] * (1 - exp(-t / 2.0)))
        columns = tuple(map(tuple, R.T))
        accelerations = plant.accelerations_6dof(
            VEHICLE, ROLL, (*through, *omega), columns, acting, tau_w
        )
        turning = np.cross(omega, np.eye(3)).T
        force = R @ (np.array(accelerations[:3]) + np.cross(omega, through)) + said
        return np.concatenate((velocity, force, (R @ turning).ravel(), accelerations[3:]))

    R = np.transpose(rotation_from_quaternion(first.quaternion))
    begun = np.concatenate((first.position, R @ first.nu_r[:3], R.ravel(), first.nu_r[3:]))
    found = solve_ivp(rates, (0.0, 20.0), np.concatenate(first), "DOP853", rtol=1e-10).y[:, -1]
    expected = solve_ivp(earth_fixed, (0.0, 20.0), begun, "DOP853", rtol=1e-10).y[:, -1]
    state = plant.PlantState(*(tuple(found[i:j]) for i, j in pairwise((0, 3, 7, 13, 16, 19))))
    rotation = np.transpose(rotation_from_quaternion(state.quaternion))
    np.testing.assert_allclose(state.position, expected[:3], atol=1e-6)
    velocity = rotation @ state.nu_r[:3] + state.water
    np.testing.assert_allclose(velocity, expected[3:6], atol=1e-7)
    np.testing.assert_allclose(rotation.ravel(), expected[6:15], atol=1e-7)
    np.testing.assert_allclose(state.water, 20.0 * np.array(said), atol=1e-9)


def test_length_of_the_quaternion_is_drawn_back():
    state = started((0.0, 0.0, 0.0, 0.3, 0.2, 0.1), (0.0, 0.0, 0.0, 1.0, 0.5, -0.5))
    for stretch in (0.99, 1.01):
        longer = state._replace(quaternion=tuple(stretch * a for a in state.quaternion))
        rotation = rotation_from_quaternion(state.quaternion)
        rate = plant.state_rates(PARAMETERS, longer, rotation, UNDRIVEN, AT_REST, *[UNDRIVEN] * 2)
        assert np.dot(rate.quaternion, longer.quaternion) * (stretch - 1.0) < 0.0


def test_noise_is_scaled_by_its_standard_deviation():
    assert plant.measure((1.0, 2.0, 3.0), (2.0, -3.0, 4.0), 0.5) == (2.0, 0.5, 5.0)
    assert plant.measure((1.0, 2.0, 3.0), (2.0, -3.0, 4.0), 0.0) == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(("seed", "same"), [(0, 0), (7, 7), (-1, 2**32 - 1), (-(2**31), 2**31)])
def test_seed_is_a_32_bit_integer_read_without_its_sign(seed, same):
    assert plant.white_noise(seed).gauss(0.0, 1.0) == Random(same).gauss(0.0, 1.0)


@given(euler=vectors(angles, 3), position=vectors(speeds, 3))
def test_initial_attitude_is_the_one_asked_for(euler, position):
    state = started((*position, *euler), AT_REST)
    assert state.position == position
    np.testing.assert_allclose(
        rotation_from_quaternion(state.quaternion), rotation_from_euler(*euler), atol=1e-15
    )


# Not in the paper: roll held at zero, ocean current, dynamics of the actuators

HELD = Parameters(VEHICLE, ROLL._replace(rolls=False))
H = 0.02


def test_held_roll_leaves_1_and_2_as_they_are_printed_beyond_the_vertical_too():
    """Five states of (1) and (2), with angles that nothing turns back, step by step."""
    tau, tau_w = (10.0, 12.0, 1.5), (0.3, -0.2, 0.1, 9.0, 0.2, -0.1)
    position, (theta, psi), nu = np.zeros(3), (0.2, 0.3), np.array([0.5, 0.1, -0.1, 0.0, 0.1])
    state = started((0.0, 0.0, 0.0, 0.0, theta, psi), (0.5, 0.1, -0.1, 0.0, 0.0, 0.1), HELD)
    steepest = 0.0
    for _ in range(400):
        dnu = accelerations(VEHICLE, tuple(nu), sin(theta), tau, (*tau_w[:3], *tau_w[4:]))
        dtheta, dpsi = euler_rates(theta, *nu[3:])
        rotation = np.column_stack(rotation_from_euler(0.0, theta, psi))
        position = position + H * rotation @ nu[:3]
        theta, psi, nu = theta + H * dtheta, psi + H * dpsi, nu + H * np.array(dnu)
        state = moved(state, tau, tau_w, H, HELD)
        steepest = max(steepest, theta)
        shown = seen(state, HELD)
        np.testing.assert_allclose(state.position, position, atol=1e-9)
        np.testing.assert_allclose(state.nu_r, np.insert(nu, 3, 0.0), atol=1e-9)
        assert shown.euler[0] == 0.0
        np.testing.assert_allclose(np.sin(shown.euler[1:]), np.sin([theta, psi]), atol=1e-9)
        np.testing.assert_allclose(np.cos(shown.euler[1:]), np.cos([theta, psi]), atol=1e-9)
    assert np.rad2deg(steepest) > 100.0


def test_roll_of_1_does_not_stay_zero_unless_it_is_held():
    """d phi/dt = p + tan(theta) (q sin(phi) + r cos(phi)): a turn of a pitched vehicle rolls it."""
    posture, turning = (0.0, 0.0, 0.0, 0.0, 0.5, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.4)
    h = 1e-5
    free = moved(started(posture, turning), UNDRIVEN, AT_REST, h)
    assert seen(free).euler[0] / h == pytest.approx(0.4 * np.tan(0.5), rel=1e-4)
    held = moved(started(posture, turning, HELD), UNDRIVEN, AT_REST, h, HELD)
    assert seen(held, HELD).euler[0] == 0.0


@pytest.mark.parametrize("parameters", [PARAMETERS, HELD])
def test_constant_current_carries_the_whole_motion_along(parameters):
    """Galilei: through the water all is as without it, and over ground it is that plus c t."""
    current, n = np.array((0.4, -0.3, 0.2)), 300
    tau, tau_w = (20.0, 3.0, 5.0), (0.5, 0.1, -0.2, 0.0, 0.1, 0.2)
    eta0, nu0 = (1.0, 2.0, 3.0, 0.0, 0.3, -0.4), np.array((0.5, 0.1, -0.1, 0.0, 0.2, 0.1))
    carried = parameters._replace(current=tuple(current))
    drift = np.column_stack(rotation_from_euler(*eta0[3:])).T @ current
    still = moved(started(eta0, tuple(nu0), parameters), tau, tau_w, H, parameters, n)
    begun = started(eta0, (*(nu0[:3] + drift), *nu0[3:]), carried)
    moving = moved(begun, tau, tau_w, H, carried, n)
    np.testing.assert_allclose(moving.nu_r, still.nu_r, atol=1e-12)
    np.testing.assert_allclose(moving.quaternion, still.quaternion, atol=1e-12)
    np.testing.assert_allclose(moving.position, still.position + n * H * current, atol=1e-10)
    without, with_it = seen(still, parameters), seen(moving, carried)
    np.testing.assert_allclose(with_it.dy, without.dy + current, atol=1e-12)
    rotation = np.column_stack(rotation_from_euler(*with_it.euler))
    over_ground = np.concatenate((still.nu_r[:3] + rotation.T @ current, still.nu_r[3:]))
    np.testing.assert_allclose(with_it.nu, over_ground, atol=1e-12)


def test_vehicle_at_rest_over_ground_is_dragged_along_as_damping_says():
    """Surge through the water is -c (1 - h d/m)^k, and the vehicle ends with the current."""
    c, n = 0.5, 200
    parameters = PARAMETERS._replace(current=(c, 0.0, 0.0))
    state = started((0.0,) * 6, AT_REST, parameters)
    assert seen(state, parameters).nu == AT_REST
    state = moved(state, UNDRIVEN, AT_REST, H, parameters, n)
    expected = c - c * (1 - H * VEHICLE.d11 / VEHICLE.m11) ** n
    assert seen(state, parameters).nu[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("parameters", [PARAMETERS, HELD])
def test_current_that_changes_leaves_the_velocity_over_ground_as_it_is(parameters):
    """From then on all is as for a vehicle that has begun there and so, in the new water."""
    tau, tau_w = (20.0, 3.0, 5.0), (0.5, 0.1, -0.2, 0.0, 0.1, 0.2)
    before = parameters._replace(current=(0.4, -0.3, 0.2))
    after = parameters._replace(current=(-0.2, 0.0, 0.5))
    begun = started((1.0, 2.0, 3.0, 0.0, 0.3, -0.4), (0.5, 0.1, -0.1, 0.0, 0.2, 0.1), before)
    state = moved(begun, tau, tau_w, H, before, 100)
    rotation = rotation_from_quaternion(state.quaternion)
    changed = plant.immersed(state, rotation, after.current)
    np.testing.assert_allclose(seen(changed, after).nu, seen(state, before).nu, atol=1e-15)
    through_water = np.subtract(changed.nu_r[:3], state.nu_r[:3])
    turned = np.column_stack(rotation_from_euler(*seen(state).euler)).T
    np.testing.assert_allclose(through_water, turned @ (0.6, -0.3, -0.3), atol=1e-14)
    fresh = started((*state.position, *seen(state).euler), seen(state, before).nu, after)
    carried = moved(state, tau, tau_w, H, after, 100)
    other = moved(fresh, tau, tau_w, H, after, 100)
    np.testing.assert_allclose(carried.nu_r, other.nu_r, atol=1e-12)
    np.testing.assert_allclose(carried.position, other.position, atol=1e-12)


def test_vehicle_in_a_current_that_comes_up_is_dragged_along_as_damping_says():
    """Surge over ground is c + (u - c) (1 - h d/m)^k from the moment at which it comes."""
    c, u, n = 0.5, 0.2, 200
    state = started((0.0,) * 6, (u, 0.0, 0.0, 0.0, 0.0, 0.0))
    parameters = PARAMETERS._replace(current=(c, 0.0, 0.0))
    state = moved(state, UNDRIVEN, AT_REST, H, parameters, n)
    expected = c + (u - c) * (1 - H * VEHICLE.d11 / VEHICLE.m11) ** n
    assert seen(state, parameters).nu[0] == pytest.approx(expected, rel=1e-12)


def test_actuators_with_a_lag_follow_a_step_as_their_equation_does():
    """tau (1 - exp(-t / T)) at every instant, from rest; the one without follows at once."""
    tau, T = (40.0, -20.0, 10.0), (0.5, 0.004, 0.0)
    parameters = PARAMETERS._replace(T=T)
    state = plant.begin(parameters, parameters.current)
    assert plant.actuation(parameters, state, tau) == (0.0, 0.0, 10.0)
    for k in range(1, 50):
        state = moved(state, tau, AT_REST, H, parameters)
        expected = [40.0 * (1 - exp(-k * H / 0.5)), -20.0 * (1 - exp(-k * H / 0.004)), 10.0]
        actual = plant.actuation(parameters, state, tau)
        np.testing.assert_allclose(actual, expected, rtol=1e-12)
        idle = plant.actuation(parameters, state, UNDRIVEN)
        assert idle == (*actual[:2], 0.0), "an actuator without a lag has no memory"


@given(st.sampled_from((1e-3, 5e-3, 0.02, 0.1, 1.0)), st.sampled_from(Integrator))
def test_vehicle_with_a_lag_has_the_impulse_of_its_actuators(T, integrator):
    """Without damping m11 u is the integral of tau (1 - exp(-t / T)): tau (t + T expm1(-t / T))."""
    tau_u, n = 40.0, 50
    vehicle = VEHICLE._replace(d11=0.0)
    parameters = Parameters(vehicle, T=(T, 0.0, 0.0), integrator=integrator)
    state = started((0.0,) * 6, AT_REST, parameters)
    for k in range(1, n + 1):
        state = moved(state, (tau_u, 0.0, 0.0), AT_REST, H, parameters)
        impulse = tau_u * (k * H + T * expm1(-k * H / T))
        assert vehicle.m11 * state.nu_r[0] == pytest.approx(impulse, rel=1e-12)


# Water that speeds up


def swept(state, parameters, steps, h, flow, tau=UNDRIVEN, tau_w=AT_REST):
    """The state after steps in water that moves as flow(t) says: its velocity and acceleration."""
    for k in range(steps):
        water, dwater = flow(k * h)
        rotation = rotation_from_quaternion(state.quaternion)
        state = plant.advance(parameters, state, rotation, tau, tau_w, water, dwater, h)
    return state


def swell(t):
    """Water that all moves alike: velocity and acceleration."""
    phases = np.array((0.9, 1.3, 1.1)) * t + (0.3, 1.2, 2.0)
    amplitudes = np.array((0.4, -0.3, 0.2))
    return (
        tuple(map(float, amplitudes * np.cos(phases))),
        tuple(map(float, -amplitudes * (0.9, 1.3, 1.1) * np.sin(phases))),
    )


@pytest.mark.parametrize("integrator", Integrator)
@pytest.mark.parametrize("rolls", [True, False])
def test_undriven_vehicle_moves_as_the_water_that_it_displaces(integrator, rolls):
    """Whatever its added mass: begun with the water and without damping, it stays with it."""
    vehicle = VEHICLE._replace(d11=0.0, d22=0.0, d33=0.0)
    roll = ROLL._replace(rolls=rolls)
    parameters = Parameters(vehicle, roll, integrator=integrator)
    water, _ = swell(0.0)
    at_start = parameters._replace(eta0=(0.0,) * 6, nu0=(*water, 0.0, 0.0, 0.0))
    begun = plant.begin(at_start, water)
    h, n = 0.002, 5000
    state = swept(begun, parameters, n, h, swell)
    amplitudes, phases = np.array((0.4, -0.3, 0.2)), np.array((0.3, 1.2, 2.0))
    omegas = np.array((0.9, 1.3, 1.1))
    particle = amplitudes / omegas * (np.sin(omegas * h * n + phases) - np.sin(phases))
    # The acceleration is held at its value at the beginning of a step: h / 2 times it is missing
    # of the velocity, 0.4 mm/s.
    np.testing.assert_allclose(seen(state, parameters).nu[:3], swell(h * n)[0], atol=1e-3)
    np.testing.assert_allclose(state.position, particle, atol=5e-3)
    # Water that is not said to speed up does not take it along.
    left = swept(begun, parameters, n, h, lambda t: (swell(t)[0], (0.0,) * 3))
    assert np.abs(np.subtract(left.position, particle)).max() > 0.3


@pytest.mark.parametrize("mass", [0.0, 5.0, 17.0])
def test_forces_of_accelerating_water_are_morisons_and_kirchhoffs(mass):
    """With rigid-body and added mass apart, and over ground, as Fossen writes it, by solve_ivp.

    M_RB dnu + C_RB(nu) nu + M_A dnu_r + C_A(nu_r) nu_r + D nu_r + g = tau + m R'a, with M_RB = m I
    in the translations. However M is split into both, the motion is the one of the plant.
    """
    stop, tau, tau_w = 3.0, (20.0, 3.0, 5.0), (0.5, 0.1, -0.2, 0.05, 0.1, 0.2)
    parameters = PARAMETERS._replace(integrator=Integrator.RK4)
    eta0, nu0 = (0.0, 0.0, 0.0, 0.2, 0.3, -0.4), (0.5, 0.1, -0.1, 0.1, 0.2, 0.1)
    added = MASSES - (mass, mass, mass, 0.0, 0.0, 0.0)

    def coriolis(masses, nu):
        momentum = masses * nu
        return np.concatenate(
            (
                np.cross(nu[3:], momentum[:3]),
                np.cross(nu[:3], momentum[:3]) + np.cross(nu[3:], momentum[3:]),
            )
        )

    def motion(t, x):
        matrix, nu = x[3:12].reshape(3, 3), x[12:]
        water, dwater = map(np.array, swell(t))
        turning = np.array([np.cross(matrix[i], nu[3:]) for i in range(3)])
        flow = np.concatenate((matrix.T @ water, np.zeros(3)))
        dflow = np.concatenate((matrix.T @ dwater + turning.T @ water, np.zeros(3)))
        nu_r = nu - flow
        righting = np.array(
            (0, 0, 0, ROLL.righting_roll * matrix[2, 1], -VEHICLE.righting_pitch * matrix[2, 0], 0)
        )
        froude_krylov = np.concatenate((mass * (matrix.T @ dwater), np.zeros(3)))
        # The rotational inertia is in `added` as a whole: there nothing depends on the split.
        rigid = np.array((mass, mass, mass, 0.0, 0.0, 0.0))
        applied = np.array((tau[0], 0, 0, 0, tau[1], tau[2])) - tau_w
        forces = (
            applied
            + froude_krylov
            - righting
            - DAMPING * nu_r
            - coriolis(rigid, nu)
            - coriolis(added, nu_r)
            + added * dflow
        )
        return np.concatenate((matrix @ nu[:3], np.ravel(turning), forces / MASSES))

    rotation = np.column_stack(rotation_from_euler(*eta0[3:]))
    begun = np.concatenate((eta0[:3], np.ravel(rotation), nu0))
    exact = solve_ivp(motion, (0.0, stop), begun, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    flow = exact[3:12].reshape(3, 3).T @ swell(stop)[0]
    through_water = np.concatenate((exact[:3], exact[12:15] - flow, exact[15:]))

    def ended(n):
        at_start = parameters._replace(eta0=eta0, nu0=nu0)
        state = plant.begin(at_start, swell(0.0)[0])
        state = swept(state, parameters, n, stop / n, swell, tau, tau_w)
        return np.concatenate((state.position, state.nu_r))

    coarse, fine = ended(150), ended(300)
    assert np.abs(coarse - through_water).max() < 5e-3
    # The acceleration is held during a step, an error of first order: extrapolated, it is gone.
    np.testing.assert_allclose(2 * fine - coarse, through_water, atol=1e-4)


@given(water=vectors(speeds, 3), dwater=vectors(speeds, 3))
def test_water_that_is_held_while_it_pushes_adds_its_acceleration_to_that_over_ground(
    water, dwater
):
    """In a long step as in short ones: without damping and turning, position + h^2 a / 2."""
    still = Vehicle(20.0, 20.0, 20.0, d11=0.0, d22=0.0, d33=0.0)
    parameters = PARAMETERS._replace(vehicle=still, current=water)
    state = started((0.0,) * 6, AT_REST, parameters)
    state = moved(state, UNDRIVEN, AT_REST, 0.1, parameters, n=4, dwater=dwater)
    np.testing.assert_allclose(state.position, np.multiply(0.08, dwater), atol=1e-12)
    np.testing.assert_allclose(seen(state, parameters).nu[:3], np.multiply(0.4, dwater), atol=1e-12)


# Integrators


def ends(parameters, tau, tau_w, n, stop):
    """Position, attitude and velocity through the water after n steps."""
    state = started((1.0, 2.0, 3.0, 0.0, 0.3, -0.4), (0.5, 0.1, -0.1, 0.0, 0.2, 0.1), parameters)
    for _ in range(n):
        state = moved(state, tau, tau_w, stop / n, parameters)
    rotation = rotation_from_quaternion(state.quaternion)
    return np.concatenate((state.position, np.ravel(rotation), state.nu_r))


@pytest.mark.parametrize("rolls", [True, False])
@pytest.mark.parametrize("lag", [0.0, 0.3])
@pytest.mark.parametrize(("integrator", "order"), [(Integrator.EULER, 1), (Integrator.RK4, 4)])
def test_integrators_have_the_orders_that_they_are_known_for(integrator, order, rolls, lag):
    """Against (1) and (2) in rotation matrices, by scipy's solve_ivp."""
    tau, tau_w, current, stop = (
        (20.0, 3.0, 5.0),
        (0.5, 0.1, -0.2, 0.0, 0.1, 0.2),
        (0.3, 0.2, 0.1),
        2.0,
    )
    roll = ROLL._replace(rolls=rolls)
    parameters = Parameters(VEHICLE, roll, current=current, T=(lag,) * 3, integrator=integrator)

    def motion(t, x):
        matrix, nu = x[3:12].reshape(3, 3), x[12:]
        columns = tuple(map(tuple, matrix))
        acting = np.multiply(tau, -np.expm1(-t / lag) if lag else 1.0)
        dnu = plant.accelerations_6dof(VEHICLE, roll, tuple(nu), columns, tuple(acting), tau_w)
        # (1) holds the roll at zero: its axes turn about the vertical at r / cos(theta).
        p = nu[3] if rolls else nu[5] * columns[0][2] / columns[2][2]
        dmatrix = [np.cross(matrix.T @ (p, nu[4], nu[5]), axis) for axis in matrix]
        return np.concatenate((matrix.T @ nu[:3] + current, np.ravel(dmatrix), dnu))

    begun = ends(parameters, tau, tau_w, 0, stop)
    exact = solve_ivp(motion, (0.0, stop), begun, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    errors = [np.abs(ends(parameters, tau, tau_w, n, stop) - exact).max() for n in (40, 80, 160)]
    for coarse, fine in pairwise(errors):
        assert np.log2(coarse / fine) == pytest.approx(order, abs=0.15)


def test_body_that_nothing_brakes_keeps_its_energy_with_rk4_and_gains_some_with_euler():
    """The energy M nu^2 / 2, in 20 s at 20 ms; Coriolis forces do no work."""
    vehicle = VEHICLE._replace(d11=0.0, d22=0.0, d33=0.0, d55=0.0, d66=0.0, righting_pitch=0.0)
    roll = ROLL._replace(d44=0.0, righting_roll=0.0)
    gains = {}
    for integrator in Integrator:
        parameters = Parameters(vehicle, roll, integrator=integrator)
        begun = started((0.0,) * 6, (1.0, 0.2, -0.1, 0.1, 0.3, 0.4), parameters)
        ended = moved(begun, UNDRIVEN, AT_REST, H, parameters, 1000)
        energies = [MASSES @ np.square(state.nu_r) for state in (begun, ended)]
        gains[integrator] = energies[1] / energies[0] - 1.0
    assert abs(gains[Integrator.RK4]) < 1e-8
    assert gains[Integrator.EULER] > 0.01
