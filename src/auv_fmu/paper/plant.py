"""The simulated vehicle with six degrees of freedom: section 4.1.

The controller is derived for five degrees of freedom; the paper simulates six and takes "the
roll interaction as an external disturbance". The plant does so literally: the terms that roll adds
to (2) enter through tau_w, so the code has (2) once, and it holds exactly when p = 0 (reading 1).
Not in the paper, and off by default: roll that is held at zero, which leaves only (1) and (2),
water that moves, actuators with dynamics, and an integrator of fourth order.
"""

from __future__ import annotations

from enum import IntEnum
from math import cos, sin, sqrt
from random import Random
from typing import Annotated, NamedTuple

from auv_fmu.language.quantities import ETA, LAG, NU, POSITION, TAU, VELOCITY
from auv_fmu.language.variable import POSITIVE, Refusal, Variable
from auv_fmu.language.vectors import (
    Rotation,
    Vector3,
    Vector4,
    Vector6,
    add,
    add_scaled,
    cross,
    sub,
)
from auv_fmu.paper.actuators import Drive, Limits, drive, follow, given, limit_all, margin
from auv_fmu.paper.attitude import (
    euler_from_rotation,
    euler_without_roll,
    normalised,
    quaternion_from_euler,
    quaternion_rates,
    rotate,
    rotate_back,
    rotation_from_quaternion,
)
from auv_fmu.paper.control_point import ELL, Distance, control_point, control_point_velocity
from auv_fmu.paper.vehicle import Vehicle, accelerations, euler_rates

#: Initial posture of section 4.1: x, y, z [m], phi, theta, psi [rad]; it does not give phi.
ETA_0: Vector6 = (2.0, 6.0, 0.0, 0.0, 0.0, 0.0)

#: Initial velocity (u, v, w, p, q, r) [m/s, rad/s]: at rest, which section 4.1 does not say.
NU_0: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

#: Largest standard deviation [m]: with it, no finite position becomes an infinite measurement.
_FARTHEST = 1e6

#: Rate at which an error of the quaternion's length decays, where a solver makes one [1/s].
NORMALISING = 0.5

_NO_FORCE = (0.0, 0.0, 0.0)
_STILL = (0.0, 0.0, 0.0)


class Integrator(IntEnum):
    """Scheme that integrates (1) and (2) over a step."""

    EULER = 0  #: Euler's scheme, as in section 4.1
    RK4 = 1  #: the classical Runge-Kutta scheme of fourth order; not in the paper


#: Module-level names, which Python looks up faster than members of the class.
EULER, RK4 = Integrator


class RollAxis(NamedTuple):
    """Parameters of roll, in addition to :class:`~auv_fmu.paper.vehicle.Vehicle`."""

    m44: Annotated[float, Variable("kg.m2", "Roll inertia with added inertia", POSITIVE)] = 22.5
    d44: Annotated[float, Variable("kg.m2/s", "Linear damping of roll", 0.0)] = 20.0
    righting_roll: Annotated[
        float,
        Variable(
            "N.m",
            "Righting moment in roll, not given in the paper; by default as in pitch",
            name="righting.roll",
        ),
    ] = 5.0
    rolls: Annotated[
        bool,
        Variable(
            "1",
            "Whether roll is free; if false, the vehicle follows (1) and (2). Not in the paper",
            name="roll",
        ),
    ] = True


class Localisation(NamedTuple):
    """The localisation system, without numbers in section 4.1 (reading 7)."""

    std: Annotated[
        float,
        Variable(
            "m",
            "Standard deviation of each measured coordinate",
            0.0,
            _FARTHEST,
        ),
    ] = 0.001
    seed: Annotated[int, Variable("1", "Seed of the noise")] = 1


class Parameters(NamedTuple):
    """All parameters of the plant."""

    vehicle: Annotated[Vehicle, Variable(name="")] = Vehicle()
    roll: Annotated[RollAxis, Variable(name="")] = RollAxis()
    ell: Distance = ELL
    limits: Annotated[Limits, Variable(name="")] = Limits()
    eta0: Annotated[Vector6, Variable(ETA, "Initial posture")] = ETA_0
    nu0: Annotated[Vector6, Variable(NU, "Initial velocity in the body frame")] = NU_0
    noise: Localisation = Localisation()
    current: Annotated[
        Vector3,
        Variable(VELOCITY, "Ocean current in the earth frame; not in the paper", tunable=True),
    ] = (0.0, 0.0, 0.0)
    T: Annotated[
        Vector3,
        Variable(
            LAG,
            "Time constant of the actuator lag, after the limits; 0: no lag. Not in the paper "
            "(Remark 2)",
            0.0,
            name="actuator.T",
        ),
    ] = (0.0, 0.0, 0.0)
    integrator: Annotated[
        Integrator,
        Variable("1", "Scheme that integrates (1) and (2): euler, as in the paper, or rk4"),
    ] = Integrator.EULER


class PlantState(NamedTuple):
    """Motion of the vehicle, with its actuators and the water."""

    position: Annotated[Vector3, Variable(POSITION, "Centre of mass in the earth frame")]
    quaternion: Annotated[Vector4, Variable("1", "Attitude, body to earth, scalar first")]
    nu_r: Annotated[Vector6, Variable(NU, "Velocity through the water in the body frame")]
    #: at the end of the last step
    tau: Annotated[Vector3, Variable(TAU, "Force and moments that act, for actuators with a lag")]
    water: Annotated[
        Vector3, Variable(VELOCITY, "Velocity of the water that nu_r is through, earth frame")
    ]


class PlantOutputs(NamedTuple):
    """Outputs of the vehicle."""

    euler: Vector3  #: roll, pitch, yaw [rad]
    y: Vector3  #: control point [m], earth frame, without measurement noise
    dy: Vector3  #: velocity of the control point [m/s], earth frame
    nu: Vector6  #: (u, v, w, p, q, r) over ground [m/s, rad/s], body frame
    nu_r: Vector6  #: the same through the water


class Rates(NamedTuple):
    """Rates of the state by (1) and (2)."""

    position: Vector3  #: [m/s], earth frame
    attitude: Vector4  #: rate of the quaternion; without roll, of (0, 0, theta, psi) [1/s, rad/s]
    nu_r: Vector6  #: d/dt (u, v, w, p, q, r) [m/s2, rad/s2]


def over_ground(nu_r: Vector6, rotation: Rotation, water: Vector3) -> Vector6:
    """Velocity over ground of a vehicle that moves through water with nu_r [m/s, rad/s].

    A constant current without rotation enters (2) only in this way: in the terms of (2) the
    velocity through the water replaces nu (Fossen).

    Args:
        nu_r: (u, v, w, p, q, r) through the water, body frame.
        rotation: body to earth.
        water: velocity of the water [m/s], earth frame.

    """
    c_x, c_y, c_z = water
    if not (c_x or c_y or c_z):
        return nu_r
    u, v, w, p, q, r = nu_r
    u_c, v_c, w_c = rotate_back(rotation, water)
    return u + u_c, v + v_c, w + w_c, p, q, r


def check_speed(nu_r: Vector6, fastest: float, fastest_turn: float) -> None:
    """Refuse a motion for which a model does not hold; the plant has no such limits.

    Args:
        nu_r: (u, v, w, p, q, r) through the water [m/s, rad/s].
        fastest: largest speed [m/s].
        fastest_turn: largest rate of turn [rad/s].

    Raises:
        Refusal: the motion is faster.

    """
    u, v, w, p, q, r = nu_r
    speed, turn = sqrt(u * u + v * v + w * w), sqrt(p * p + q * q + r * r)
    if not (speed <= fastest and turn <= fastest_turn):
        raise Refusal(
            f"the vehicle moves at {speed:.3g} m/s through the water and turns at {turn:.3g} "
            f"rad/s; the model ends at {fastest:g} m/s and {fastest_turn:g} rad/s: mend water, "
            "nu0 or h_max"
        )


def immersed(state: PlantState, rotation: Rotation, water: Vector3) -> PlantState:
    """The same motion over ground, in water that moves at another velocity.

    If the velocity of the water jumps, the velocity through the water jumps too, because the
    vehicle keeps its own. Changes that :func:`carried` has applied are not counted again.

    Args:
        state: of the vehicle, in water of another velocity.
        rotation: body to earth, of its quaternion.
        water: velocity of the water from now on [m/s], earth frame.

    """
    change = sub(state.water, water)
    c_x, c_y, c_z = change
    if not (c_x or c_y or c_z):
        return state
    nu_r = over_ground(state.nu_r, rotation, change)
    return PlantState(state.position, state.quaternion, nu_r, state.tau, water)


def carried(state: PlantState, dwater: Vector3, h: float) -> PlantState:
    """State after a step with accelerating water, from the state after a step without.

    Accelerating water carries a neutrally buoyant vehicle along like the water that it displaces.
    With the mass m of both, the added mass A and the acceleration a of the water, the forces of the
    water (Froude-Krylov m a, added mass A (a - dv/dt)) give

        m dv/dt = m a + A (a - dv/dt) + ...,   so   (m + A) d(v - water)/dt = ...

    So (2) holds for the velocity through the water as in still water, with M = m + A as a whole.
    Only the motion over ground changes: the velocity by h a over the step, and the position by
    h^2 a / 2.

    Args:
        state: of the vehicle after the step, with the water as it was at the beginning.
        dwater: acceleration of the water [m/s2], earth frame.
        h: step [s].

    """
    a_x, a_y, a_z = dwater
    if not (a_x or a_y or a_z):
        return state
    return PlantState(
        add_scaled(state.position, 0.5 * h * h, dwater),
        state.quaternion,
        state.nu_r,
        state.tau,
        add_scaled(state.water, h, dwater),
    )


def accelerations_6dof(
    vehicle: Vehicle, roll: RollAxis, nu: Vector6, rotation: Rotation, tau: Vector3, tau_w: Vector6
) -> Vector6:
    """Equation (2) with roll, for a diagonal M: body-fixed accelerations.

    Args:
        vehicle, roll: parameters.
        nu: (u, v, w, p, q, r) [m/s, rad/s], body frame.
        rotation: body to earth.
        tau: applied (tau_u, tau_q, tau_r) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m]; enters with a minus.

    Returns:
        d/dt (u, v, w, p, q, r) [m/s2, rad/s2].

    """
    m44, d44, righting_roll, rolls = roll
    m22, m33, m55, m66 = vehicle.m22, vehicle.m33, vehicle.m55, vehicle.m66
    u, v, w, p, q, r = nu
    tau_wu, tau_wv, tau_ww, tau_wp, tau_wq, tau_wr = tau_w
    sin_theta, cos_theta_sin_phi = -rotation[0][2], rotation[1][2]
    du, dv, dw, dq, dr = accelerations(
        vehicle,
        (u, v, w, q, r),
        sin_theta,
        tau,
        (
            tau_wu,
            tau_wv - m33 * w * p,
            tau_ww + m22 * v * p,
            tau_wq - (m66 - m44) * p * r,
            tau_wr - (m44 - m55) * p * q,
        ),
    )
    dp = (
        (m22 - m33) * v * w
        + (m55 - m66) * q * r
        - d44 * p
        - righting_roll * cos_theta_sin_phi
        - tau_wp
    ) / m44
    return du, dv, dw, dp if rolls else 0.0, dq, dr


def rates(
    vehicle: Vehicle,
    roll: RollAxis,
    state: PlantState,
    rotation: Rotation,
    tau: Vector3,
    tau_w: Vector6,
) -> Rates:
    """Equations (1) and (2): rates of the motion.

    Args:
        vehicle, roll: parameters.
        state: of the vehicle.
        rotation: body to earth, of its quaternion.
        tau: applied (tau_u, tau_q, tau_r) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].

    """
    _, quaternion, nu_r, _, water = state
    u, v, w, p, q, r = nu_r
    velocity = rotate(rotation, (u, v, w))
    c_x, c_y, c_z = water
    if c_x or c_y or c_z:
        velocity = add(velocity, water)
    dnu = accelerations_6dof(vehicle, roll, nu_r, rotation, tau, tau_w)
    if roll.rolls:
        return Rates(velocity, quaternion_rates(quaternion, (p, q, r)), dnu)
    _, theta, _ = euler_without_roll(rotation)
    dtheta, dpsi = euler_rates(theta, q, r)
    return Rates(velocity, (0.0, 0.0, dtheta, dpsi), dnu)


def state_rates(
    parameters: Parameters,
    state: PlantState,
    rotation: Rotation,
    tau: Vector3,
    tau_w: Vector6,
    water: Vector3,
    dwater: Vector3,
) -> PlantState:
    """Rates of the whole state, for a solver with steps of its own.

    The velocity of the state is through water that has accelerated by dwater since the last jump.
    If the water moves differently, the vehicle is in the present water nevertheless: with v_s and v
    through the water of the state and the present one, the motion over ground gives

        dv_s/dt + omega x v_s = dv/dt + omega x v.

    The length of the quaternion is drawn back to one.

    Args:
        parameters: of the plant.
        state, rotation: of the vehicle.
        tau: command (tau_u, tau_q, tau_r) after the limits of (3) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        water: velocity of the water [m/s], earth frame.
        dwater: its acceleration [m/s2], earth frame.

    """
    now = immersed(state, rotation, water)
    acting = given(state.tau, tau, parameters.T)
    rate = rates(parameters.vehicle, parameters.roll, now, rotation, acting, tau_w)
    _, _, _, p, q, r = state.nu_r
    if not parameters.roll.rolls:
        # The rate of the body about its axis that keeps the starboard axis level.
        _, theta, _ = euler_without_roll(rotation)
        p = -r * sin(theta) / cos(theta)
    x, y, z = cross((p, q, r), rotate_back(rotation, sub(state.water, water)))
    a, b, c, d = state.quaternion
    da, db, dc, dd = quaternion_rates(state.quaternion, (p, q, r))
    k = NORMALISING * (1.0 - (a * a + b * b + c * c + d * d))
    du, dv, dw, dp, dq, dr = rate.nu_r
    T_u, T_q, T_r = parameters.T
    return PlantState(
        rate.position,
        (da + k * a, db + k * b, dc + k * c, dd + k * d),
        (du + x, dv + y, dw + z, dp, dq, dr),
        (
            follow(state.tau[0], tau[0], T_u),
            follow(state.tau[1], tau[1], T_q),
            follow(state.tau[2], tau[2], T_r),
        ),
        dwater,
    )


def moved(
    roll: RollAxis, state: PlantState, rotation: Rotation, rate: Rates, tau: Vector3, h: float
) -> PlantState:
    """State after h seconds at constant rates.

    Args:
        roll: parameters.
        state: of the vehicle.
        rotation: body to earth, of its quaternion.
        rate: of the state.
        tau: applied (tau_u, tau_q, tau_r) after that time [N, N.m].
        h: time [s].

    """
    position, (a, b, c, d), (u, v, w, p, q, r), _, water = state
    _, (da, db, dc, dd), (du, dv, dw, dp, dq, dr) = rate
    position = add_scaled(position, h, rate.position)
    nu = u + h * du, v + h * dv, w + h * dw, p + h * dp, q + h * dq, r + h * dr
    if roll.rolls:
        attitude = normalised((a + h * da, b + h * db, c + h * dc, d + h * dd))
        return PlantState(position, attitude, nu, tau, water)
    phi, theta, psi = euler_without_roll(rotation)
    attitude = quaternion_from_euler(phi, theta + h * dc, psi + h * dd)
    return PlantState(position, attitude, nu, tau, water)


def step(
    parameters: Parameters,
    state: PlantState,
    rotation: Rotation,
    acting: Drive,
    tau_w: Vector6,
    h: float,
) -> PlantState:
    """One step of Euler's scheme under held inputs.

    Args:
        parameters: of the plant.
        state: at the beginning of the step.
        rotation: body to earth, of its quaternion.
        acting: outputs of the actuators.
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        h: step [s].

    """
    vehicle, roll = parameters.vehicle, parameters.roll
    rate = rates(vehicle, roll, state, rotation, acting.mean, tau_w)
    return moved(roll, state, rotation, rate, acting.last, h)


def step_rk4(
    parameters: Parameters,
    state: PlantState,
    rotation: Rotation,
    acting: Drive,
    tau_w: Vector6,
    h: float,
) -> PlantState:
    """One step of the classical Runge-Kutta scheme under held inputs; arguments as for `step`."""
    vehicle, roll = parameters.vehicle, parameters.roll
    one = rates(vehicle, roll, state, rotation, acting.first, tau_w)
    near = moved(roll, state, rotation, one, acting.middle, 0.5 * h)
    turned = rotation_from_quaternion(near.quaternion)
    two = rates(vehicle, roll, near, turned, acting.middle, tau_w)
    near = moved(roll, state, rotation, two, acting.middle, 0.5 * h)
    turned = rotation_from_quaternion(near.quaternion)
    three = rates(vehicle, roll, near, turned, acting.middle, tau_w)
    near = moved(roll, state, rotation, three, acting.last, h)
    turned = rotation_from_quaternion(near.quaternion)
    four = rates(vehicle, roll, near, turned, acting.last, tau_w)
    rate = weighted(one, two, three, four)
    return moved(roll, state, rotation, rate, acting.last, h)


def weighted(one: Rates, two: Rates, three: Rates, four: Rates) -> Rates:
    """Mean rates of a step, from rates at its beginning, twice halfway, and at its end."""
    return Rates(
        (
            mean(one.position[0], two.position[0], three.position[0], four.position[0]),
            mean(one.position[1], two.position[1], three.position[1], four.position[1]),
            mean(one.position[2], two.position[2], three.position[2], four.position[2]),
        ),
        (
            mean(one.attitude[0], two.attitude[0], three.attitude[0], four.attitude[0]),
            mean(one.attitude[1], two.attitude[1], three.attitude[1], four.attitude[1]),
            mean(one.attitude[2], two.attitude[2], three.attitude[2], four.attitude[2]),
            mean(one.attitude[3], two.attitude[3], three.attitude[3], four.attitude[3]),
        ),
        (
            mean(one.nu_r[0], two.nu_r[0], three.nu_r[0], four.nu_r[0]),
            mean(one.nu_r[1], two.nu_r[1], three.nu_r[1], four.nu_r[1]),
            mean(one.nu_r[2], two.nu_r[2], three.nu_r[2], four.nu_r[2]),
            mean(one.nu_r[3], two.nu_r[3], three.nu_r[3], four.nu_r[3]),
            mean(one.nu_r[4], two.nu_r[4], three.nu_r[4], four.nu_r[4]),
            mean(one.nu_r[5], two.nu_r[5], three.nu_r[5], four.nu_r[5]),
        ),
    )


def mean(one: float, two: float, three: float, four: float) -> float:
    """Simpson's mean, with two values for the middle."""
    return (one + 2.0 * (two + three) + four) / 6.0


def begin(parameters: Parameters, water: Vector3) -> PlantState:
    """State at the start, with actuators at rest.

    Args:
        parameters: of the plant.
        water: velocity of the water [m/s], earth frame.

    """
    x, y, z, phi, theta, psi = parameters.eta0
    quaternion = quaternion_from_euler(phi, theta, psi)
    state = PlantState((x, y, z), quaternion, parameters.nu0, _NO_FORCE, _STILL)
    return immersed(state, rotation_from_quaternion(quaternion), water)


def flow(parameters: Parameters, water: Vector3) -> Vector3:
    """Velocity of the water: the parameter `current` plus the input [m/s]."""
    return add(parameters.current, water)


def applied(parameters: Parameters, tau: Vector3) -> Vector3:
    """Equation (3): a command (tau_u, tau_q, tau_r) within the limits [N, N.m]."""
    return limit_all(tau, parameters.limits.tau_min, parameters.limits.tau_max)


def margins(parameters: Parameters, tau: Vector3) -> Vector3:
    """Distances of a command (tau_u, tau_q, tau_r) from the limits of (3) [N, N.m]."""
    lower, upper = parameters.limits
    return (
        margin(tau[0], lower[0], upper[0]),
        margin(tau[1], lower[1], upper[1]),
        margin(tau[2], lower[2], upper[2]),
    )


def actuation(parameters: Parameters, state: PlantState, tau: Vector3) -> Vector3:
    """Outputs of the actuators (tau_u, tau_q, tau_r) [N, N.m].

    Args:
        parameters: of the plant.
        state: of the vehicle.
        tau: command after the limits of (3) [N, N.m].

    """
    return given(state.tau, tau, parameters.T)


def advance(
    parameters: Parameters,
    state: PlantState,
    rotation: Rotation,
    tau: Vector3,
    tau_w: Vector6,
    water: Vector3,
    dwater: Vector3,
    h: float,
) -> PlantState:
    """State after a step under held inputs, by the integrator of the parameters.

    Args:
        parameters: of the plant.
        state, rotation: at the beginning.
        tau: (tau_u, tau_q, tau_r) after the limits of (3) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        water: velocity of the water at the beginning [m/s], earth frame.
        dwater: its acceleration [m/s2], earth frame.
        h: step [s].

    """
    T_u, T_q, T_r = parameters.T
    state = immersed(state, rotation, water)
    acts = Drive(tau, tau, tau, tau)
    if T_u or T_q or T_r:
        acts = drive(state.tau, tau, parameters.T, h)
    if parameters.integrator == RK4:
        state = step_rk4(parameters, state, rotation, acts, tau_w, h)
    else:
        state = step(parameters, state, rotation, acts, tau_w, h)
    return carried(state, dwater, h)


def outputs(state: PlantState, rotation: Rotation, ell: float, rolls: bool) -> PlantOutputs:
    """Euler angles, control point (9), its velocity (10), and the velocity of the vehicle.

    Args:
        state: of the vehicle.
        rotation: body to earth, of its quaternion.
        ell: distance of the control point [m].
        rolls: True if roll is free.

    """
    position, _, nu_r, _, water = state
    nu = over_ground(nu_r, rotation, water)
    return PlantOutputs(
        euler_from_rotation(rotation) if rolls else euler_without_roll(rotation),
        control_point(position, rotation, ell),
        control_point_velocity(rotation, nu, ell),
        nu,
        nu_r,
    )


def white_noise(seed: int) -> Random:
    """Generator of the localisation system's noise.

    Args:
        seed: any 32-bit integer. It is made positive, because Random ignores the sign.

    """
    return Random(seed % 2**32)


def measure(y: Vector3, n: Vector3, std: float) -> Vector3:
    """The localisation system: y with white noise.

    Args:
        y: control point [m], earth frame.
        n: three independent standard normal numbers.
        std: standard deviation of each axis [m]; not in the paper (reading 7).

    """
    return add_scaled(y, std, n)
