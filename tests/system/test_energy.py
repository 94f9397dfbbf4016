"""Energy of the vehicle: only actuators, disturbances and moving water may add to it.

Its kinetic energy nu_r' M nu_r / 2 belongs to the motion through the water, with the added mass. A
righting moment G that is the same in pitch and roll has the potential -G cos(theta) cos(phi).
"""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.bluerov2 import bluerov2
from auv_fmu.paper import plant
from auv_fmu.paper.attitude import rotation_from_euler, rotation_from_quaternion
from auv_fmu.paper.plant import Integrator, Parameters, RollAxis
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.remus import hull, remus100
from support.strategies import angles, pitch_angles, speeds, vectors

NONE_3, NONE_6 = (0.0,) * 3, (0.0,) * 6

masses = st.floats(5.0, 200.0)
dampings = st.floats(0.0, 50.0)
rightings = st.floats(0.0, 50.0)


@st.composite
def parameter_sets(draw, rolls=None):
    """Any vehicle whose righting moments come from one centre of buoyancy."""
    G = draw(rightings)
    vehicle = Vehicle(*draw(vectors(masses, 5)), *draw(vectors(dampings, 5)), G)
    is_free = draw(st.booleans()) if rolls is None else rolls
    roll = RollAxis(draw(masses), draw(dampings), G, is_free)
    return Parameters(vehicle, roll, integrator=Integrator.RK4)


def mass_and_damping(parameters):
    m11, m22, m33, m55, m66, d11, d22, d33, d55, d66, _ = parameters.vehicle
    roll = parameters.roll
    return np.array((m11, m22, m33, roll.m44, m55, m66)), np.array(
        (d11, d22, d33, roll.d44, d55, d66)
    )


def energy(parameters, state):
    """Kinetic and potential [J], not negative."""
    mass, _ = mass_and_damping(parameters)
    upright = rotation_from_quaternion(state.quaternion)[2][2]
    kinetic = np.dot(mass * state.nu_r, state.nu_r) / 2
    return kinetic + parameters.vehicle.righting_pitch * (1.0 - upright)


def drifted(parameters, state, water, dwater, h):
    """A step without actuators and disturbances."""
    rotation = rotation_from_quaternion(state.quaternion)
    return plant.advance(parameters, state, rotation, NONE_3, NONE_6, water, dwater, h)


@given(parameters=parameter_sets(), position=vectors(speeds, 3), psi=angles)
def test_vehicle_at_rest_and_level_in_still_water_stays_so(parameters, position, psi):
    state = later = plant.begin(parameters._replace(eta0=(*position, 0.0, 0.0, psi)), NONE_3)
    for _ in range(10):
        later = drifted(parameters, later, NONE_3, NONE_3, 0.02)
    assert later.position == state.position
    assert later.nu_r == NONE_6
    np.testing.assert_allclose(later.quaternion, state.quaternion, atol=1e-15)


@given(parameters=parameter_sets(rolls=True), nu=vectors(speeds, 6), euler=vectors(angles, 3))
def test_power_comes_from_damping_only(parameters, nu, euler):
    """d/dt energy = -nu_r' D nu_r, of the right-hand side itself, for every vehicle and state."""
    mass, damping = mass_and_damping(parameters)
    rotation = rotation_from_euler(*euler)
    vehicle, roll = parameters.vehicle, parameters.roll
    dnu = plant.accelerations_6dof(vehicle, roll, nu, rotation, NONE_3, NONE_6)
    phi, theta, _ = euler
    # With the earth's z-axis in the body, z: d/dt R33 = z_x q - z_y p.
    upright_rate = -sin(theta) * nu[4] - cos(theta) * sin(phi) * nu[3]
    righting = vehicle.righting_pitch * upright_rate
    power = np.dot(mass * nu, dnu) - righting
    scale = np.dot(mass, np.square(nu)) * (1.0 + max(np.abs(nu))) + abs(righting)
    np.testing.assert_allclose(power, -np.dot(damping * nu, nu), rtol=1e-12, atol=1e-12 * scale)
    assert power <= 1e-12 * (scale + 1.0)


@given(
    parameters=parameter_sets(),
    euler=st.tuples(angles, pitch_angles, angles),
    nu=vectors(speeds, 6),
    water=vectors(speeds, 3),
    dwater=vectors(speeds, 3),
)
def test_energy_never_grows_by_itself_in_any_steady_or_speeding_water(
    parameters, euler, nu, water, dwater
):
    """Runs of the plant, in the frame of the water; the scheme of fourth order may add 1e-6."""
    if not parameters.roll.rolls:
        euler, nu = (0.0, 0.3 * euler[1], euler[2]), (*nu[:3], 0.0, *(0.3 * x for x in nu[4:]))
    eta0 = (0.0, 0.0, 0.0, *euler)
    state = plant.begin(parameters._replace(eta0=eta0, nu0=nu), water)
    before = first = energy(parameters, state)
    for k in range(40):
        now = tuple(np.add(water, np.multiply(0.0025 * k, dwater)).tolist())
        state = drifted(parameters, state, now, dwater, 0.0025)
        after = energy(parameters, state)
        assert after <= before + 1e-6 * (first + 1.0)
        before = after


@pytest.mark.parametrize(("pitch", "roll"), [(5.0, 5.0), (5.0, 8.0)])
def test_righting_moments_that_differ_are_of_no_potential(pitch, roll):
    """They do work on a closed path: pitch up by a, turn by 90 degrees about the mast, roll back.

    Against pitch G_p (1 - cos(a)) is spent, and from roll G_r (1 - cos(a)) is gained: a body with
    one centre of buoyancy has equal moments, and only those make no energy.
    """
    vehicle, axis, a = Vehicle(righting_pitch=pitch), RollAxis(righting_roll=roll), 0.6

    def moments(tilt_x, tilt_y):
        """Righting moments on a tilted body at rest, from the earth's z-axis in it."""
        z = np.array((tilt_x, tilt_y, np.sqrt(1.0 - tilt_x**2 - tilt_y**2)))
        x = np.cross((0.0, 1.0, 0.0), z)
        x /= np.linalg.norm(x)
        # Rows of R are the earth's axes in the body; its columns are what the plant takes.
        rows = np.array((x, np.cross(z, x), z))
        columns = tuple(map(tuple, rows.T))
        dnu = plant.accelerations_6dof(vehicle, axis, NONE_6, columns, NONE_3, NONE_6)
        return axis.m44 * dnu[3], vehicle.m55 * dnu[4]

    angles_on_the_way, width = np.linspace(0.0, a, 501, retstep=True)
    middle = (angles_on_the_way[1:] + angles_on_the_way[:-1]) / 2
    # z turns by z' = z x omega: pitch by +angle gives z_x = -sin(angle).
    up = sum(moments(-sin(x), 0.0)[1] for x in middle) * width
    # The turn about the body's z-axis takes no moment in yaw; then z_y = sin(angle), back to 0.
    back = -sum(moments(0.0, sin(x))[0] for x in middle) * width
    assert up == pytest.approx(-pitch * (1.0 - cos(a)), rel=1e-6)
    assert up + back == pytest.approx((roll - pitch) * (1.0 - cos(a)), abs=1e-6)


# The REMUS 100


@given(psi=angles, position=vectors(speeds, 3))
def test_remus_100_at_rest_and_level_in_still_water_stays_so(psi, position):
    vehicle = remus100.Parameters(eta0=(*position, 0.0, 0.0, psi))
    state = later = remus100.begin(vehicle, NONE_3)
    for _ in range(10):
        later = remus100.advance(vehicle, later, NONE_3, NONE_3, NONE_3, 0.02)
    assert (later.position, later.euler, later.nu) == (state.position, state.euler, NONE_6)


@given(
    velocity=vectors(st.floats(-3.0, 3.0), 3),
    rates=vectors(st.floats(-1.0, 1.0), 3),
    phi=st.floats(-1.0, 1.0),
    theta=st.floats(-1.0, 1.0),
)
def test_remus_100_with_idle_actuators_only_loses_energy(velocity, rates, phi, theta):
    """d/dt (nu' M nu / 2) is the work of righting, and of damping and fins, which brake."""
    vehicle, nu = remus100.Parameters(), np.array((*velocity, *rates))
    mass = hull.inertia(vehicle.hull)
    M = np.array([[mass.M[i, j] for j in range(6)] for i in range(6)])
    state = remus100.RemusState(NONE_3, (phi, theta, 0.0), tuple(nu), NONE_3, NONE_3)
    dnu = np.array(remus100.accelerations(vehicle, mass, state))
    work_of_righting = np.dot(rates, hull.restoring(vehicle.hull, phi, theta)[1])
    scale = 1.0 + nu @ M @ nu
    assert nu @ M @ dnu - work_of_righting <= 1e-9 * scale
    assert abs(np.dot(nu, hull.coriolis(vehicle.hull, mass, tuple(nu)))) <= 1e-9 * scale**1.5


# The BlueROV2 Heavy


@given(
    velocity=vectors(st.floats(-2.0, 2.0), 3),
    rates=vectors(st.floats(-5.0, 5.0), 3),
    phi=st.floats(-3.0, 3.0),
    theta=st.floats(-1.5, 1.5),
)
def test_bluerov2_without_thrust_only_loses_energy(velocity, rates, phi, theta):
    """d/dt (nu' M nu / 2) less the work of weight and buoyancy is the work of the drag."""
    vehicle, nu = bluerov2.Parameters(), np.array((*velocity, *rates))
    body, added = vehicle.body, vehicle.hydrodynamics.added
    M = np.array((body.mass,) * 3 + body.inertia) + added
    rotation = rotation_from_euler(phi, theta, 0.0)
    down = np.array(rotation) @ (0.0, 0.0, body.gravity)
    dnu = bluerov2.accelerations(vehicle, tuple(nu), rotation, NONE_6, NONE_6, NONE_3)
    buoyancy = -body.rho * body.volume * down
    at_centre = nu[:3] + np.cross(nu[3:], body.r_b)
    weighing = body.mass * down @ nu[:3] + buoyancy @ at_centre
    lost = nu @ (M * dnu) - weighing
    drag = vehicle.hydrodynamics.linear + vehicle.hydrodynamics.quadratic * np.abs(nu)
    scale = 1.0 + nu @ (M * nu)
    assert lost <= 1e-9 * scale**1.5
    assert lost == pytest.approx(-nu @ (drag * nu), abs=1e-9 * scale**1.5)


def test_bluerov2_without_thrust_loses_energy_along_a_run():
    """A tumble in small steps: kinetic and potential energy together never grow."""
    body = bluerov2.Body(volume=0.0135)
    nu0 = (1.0, -0.5, 0.3, 4.0, -3.0, 5.0)
    vehicle = bluerov2.Parameters(body=body, nu0=nu0)
    M = np.array((body.mass,) * 3 + body.inertia) + vehicle.hydrodynamics.added
    state, h, before = bluerov2.begin(vehicle, NONE_3), 5e-4, np.inf
    for _ in range(4000):
        rotation = rotation_from_quaternion(state.quaternion)
        upright = body.mass * body.gravity * -body.r_b[2] * (1.0 - rotation[2][2])
        now = np.dot(M * state.nu_r, state.nu_r) / 2.0 + upright
        assert now <= before + 1e-9
        before = now
        state = bluerov2.advance(vehicle, state, rotation, state.thrust, NONE_6, NONE_3, NONE_3, h)
    assert now < 1.0
