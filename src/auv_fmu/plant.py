"""The simulated vehicle with six degrees of freedom: section 4.1.

The controller is derived on five degrees of freedom; the paper simulates six and takes "the
roll interaction as an external disturbance". The plant does that to the letter: the terms that
roll adds to (2) enter through tau_w, so (2) stands once and is met exactly when p = 0
(reading 1). Not in the paper, and off by default: roll that is held at zero, which leaves (1) and
(2) alone, an ocean current, and actuators with dynamics.
"""

from __future__ import annotations

from random import Random
from typing import NamedTuple

from auv_fmu.actuators import Limits, limit_all, respond_all
from auv_fmu.attitude import (
    euler_from_rotation,
    euler_without_roll,
    normalised,
    quaternion_from_euler,
    quaternion_rates,
    rotate,
    rotate_back,
    rotation_from_quaternion,
)
from auv_fmu.control_point import ELL, control_point, control_point_velocity
from auv_fmu.types import Rotation, Vector3, Vector4, Vector6
from auv_fmu.vectors import difference
from auv_fmu.vehicle import Vehicle, accelerations, euler_rates

#: Initial posture of section 4.1: x, y, z [m], phi, theta, psi [rad]; it does not give phi.
ETA_0: Vector6 = (2.0, 6.0, 0.0, 0.0, 0.0, 0.0)

#: Initial velocity (u, v, w, p, q, r) [m/s, rad/s]: at rest, which section 4.1 does not say.
NU_0: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_NO_FORCE = (0.0, 0.0, 0.0)
_STILL = (0.0, 0.0, 0.0)


class RollAxis(NamedTuple):
    """What the sixth degree of freedom adds to :class:`~auv_fmu.vehicle.Vehicle`."""

    m44: float = 22.5  #: roll inertia with added inertia [kg.m2]
    d44: float = 20.0  #: roll damping [kg.m2/s]
    righting_roll: float = 5.0  #: righting moment in roll [N.m]; not in the paper (reading 1)
    rolls: bool = True  #: whether the vehicle rolls; if not, it is the one of (1) and (2)


class Localisation(NamedTuple):
    """The localisation system; section 4.1 gives none of its numbers (reading 7)."""

    std: float = 0.001  #: standard deviation of each measured coordinate [m]
    seed: int = 1  #: of the white noise


class Parameters(NamedTuple):
    """All parameters of the plant."""

    vehicle: Vehicle = Vehicle()
    roll: RollAxis = RollAxis()
    ell: float = ELL  #: distance of the control point [m]
    limits: Limits = Limits()
    eta0: Vector6 = ETA_0  #: initial posture (x, y, z, phi, theta, psi) [m, rad]
    nu0: Vector6 = NU_0  #: initial velocity (u, v, w, p, q, r) [m/s, rad/s]
    noise: Localisation = Localisation()
    current: Vector3 = (0.0, 0.0, 0.0)  #: velocity of the water [m/s], earth frame
    T: Vector3 = (0.0, 0.0, 0.0)  #: time constants of the actuators u, q, r [s]; 0: none


class PlantState(NamedTuple):
    """Motion of the vehicle, and what drives it."""

    position: Vector3  #: centre of mass (x, y, z) [m], earth frame
    quaternion: Vector4  #: attitude, body to earth, scalar first
    nu: Vector6  #: (u, v, w, p, q, r) through the water [m/s, rad/s], body frame
    tau: Vector3  #: (tau_u, tau_q, tau_r) that acts [N, N.m]
    water: Vector3  #: velocity of the water that nu is through [m/s], earth frame


class PlantOutputs(NamedTuple):
    """What can be seen of the vehicle."""

    euler: Vector3  #: roll, pitch, yaw [rad]
    y: Vector3  #: control point [m], earth frame, without measurement noise
    dy: Vector3  #: velocity of the control point [m/s], earth frame
    nu: Vector6  #: (u, v, w, p, q, r) over ground [m/s, rad/s], body frame


def over_ground(nu: Vector6, rotation: Rotation, current: Vector3) -> Vector6:
    """Velocity over ground of a vehicle that moves through water with nu [m/s, rad/s].

    A constant current without rotation enters (2) through this alone: the terms of (2) take the
    velocity through the water in the place of nu (Fossen).

    Args:
        nu: (u, v, w, p, q, r) through the water, body frame.
        rotation: body to earth.
        current: velocity of the water [m/s], earth frame.

    """
    u, v, w, p, q, r = nu
    u_c, v_c, w_c = rotate_back(rotation, current)
    return u + u_c, v + v_c, w + w_c, p, q, r


def immersed(state: PlantState, rotation: Rotation, current: Vector3) -> PlantState:
    """The same motion over ground, in water that moves with a current.

    A current that changes at an instant changes the velocity through the water, as a vehicle with
    a mass keeps its own.

    Args:
        state: of the vehicle, in whatever water it has been.
        rotation: body to earth, of its quaternion.
        current: velocity of the water from now on [m/s], earth frame.

    """
    change = difference(state.water, current)
    c_x, c_y, c_z = change
    if not (c_x or c_y or c_z):
        return state
    nu = over_ground(state.nu, rotation, change)
    return PlantState(state.position, state.quaternion, nu, state.tau, current)


def accelerations_6dof(
    vehicle: Vehicle, roll: RollAxis, nu: Vector6, rotation: Rotation, tau: Vector3, tau_w: Vector6
) -> Vector6:
    """Body-fixed accelerations with roll: (2) and the terms of a diagonal M that p adds.

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
    u, v, w, p, q, r = nu
    tau_wu, tau_wv, tau_ww, tau_wp, tau_wq, tau_wr = tau_w
    sin_theta, cos_theta_sin_phi = -rotation[0][2], rotation[1][2]
    m22, m33, m55, m66 = vehicle.m22, vehicle.m33, vehicle.m55, vehicle.m66
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


def turned_without_roll(rotation: Rotation, q: float, r: float, h: float) -> Vector4:
    """Attitude after one Euler step of (1), whose roll is zero.

    Args:
        rotation: body to earth, without roll.
        q, r: pitch and yaw rate in the body frame [rad/s].
        h: step [s].

    """
    phi, theta, psi = euler_without_roll(rotation)
    dtheta, dpsi = euler_rates(theta, q, r)
    return quaternion_from_euler(phi, theta + h * dtheta, psi + h * dpsi)


def step(
    vehicle: Vehicle,
    roll: RollAxis,
    state: PlantState,
    rotation: Rotation,
    tau: Vector3,
    tau_w: Vector6,
    h: float,
) -> PlantState:
    """One Euler step of the vehicle under held inputs.

    Args:
        vehicle, roll: parameters.
        state: at the beginning of the step.
        rotation: body to earth, of its quaternion; its outputs need it too.
        tau: (tau_u, tau_q, tau_r) that acts [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        h: step [s].

    """
    (x, y, z), quaternion, nu, _, water = state
    u, v, w, p, q, r = nu
    du, dv, dw, dp, dq, dr = accelerations_6dof(vehicle, roll, nu, rotation, tau, tau_w)
    dx, dy, dz = rotate(rotation, (u, v, w))
    c_x, c_y, c_z = water
    position = x + h * dx, y + h * dy, z + h * dz
    if c_x or c_y or c_z:
        position = x + h * (dx + c_x), y + h * (dy + c_y), z + h * (dz + c_z)
    moved = u + h * du, v + h * dv, w + h * dw, p + h * dp, q + h * dq, r + h * dr
    if not roll.rolls:
        return PlantState(position, turned_without_roll(rotation, q, r, h), moved, tau, water)
    a, b, c, d = quaternion
    da, db, dc, dd = quaternion_rates(quaternion, (p, q, r))
    attitude = normalised((a + h * da, b + h * db, c + h * dc, d + h * dd))
    return PlantState(position, attitude, moved, tau, water)


def begin(parameters: Parameters, tau: Vector3) -> tuple[PlantState, Rotation]:
    """State at the start, and its attitude.

    Args:
        parameters: of the plant.
        tau: (tau_u, tau_q, tau_r) after the limits of (3), if it is known [N, N.m].

    """
    x, y, z, phi, theta, psi = parameters.eta0
    quaternion = quaternion_from_euler(phi, theta, psi)
    rotation = rotation_from_quaternion(quaternion)
    acting = respond_all(_NO_FORCE, tau, parameters.T, 0.0)
    state = PlantState((x, y, z), quaternion, parameters.nu0, acting, _STILL)
    return immersed(state, rotation, parameters.current), rotation


def applied(parameters: Parameters, tau: Vector3) -> Vector3:
    """What the limits (3) leave of a command (tau_u, tau_q, tau_r) [N, N.m]."""
    return limit_all(tau, parameters.limits.tau_min, parameters.limits.tau_max)


def steps(
    parameters: Parameters,
    state: PlantState,
    rotation: Rotation,
    tau: Vector3,
    tau_w: Vector6,
    h: float,
    n: int,
) -> tuple[PlantState, Rotation]:
    """State after n steps of h seconds under held inputs, and its attitude.

    Args:
        parameters: of the plant.
        state, rotation: at the beginning.
        tau: (tau_u, tau_q, tau_r) after the limits of (3) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        h: step [s].
        n: how many.

    """
    T_u, T_q, T_r = parameters.T
    acting = tau
    state = immersed(state, rotation, parameters.current)
    while n > 0:
        if T_u or T_q or T_r:
            acting = respond_all(state.tau, tau, parameters.T, h)
        state = step(
            parameters.vehicle,
            parameters.roll,
            state,
            rotation,
            acting,
            tau_w,
            h,
        )
        rotation = rotation_from_quaternion(state.quaternion)
        n -= 1
    return state, rotation


def outputs(state: PlantState, rotation: Rotation, ell: float, rolls: bool) -> PlantOutputs:
    """Euler angles, control point (9), its velocity (10), and the velocity of the vehicle.

    Args:
        state: of the vehicle.
        rotation: body to earth, of its quaternion.
        ell: distance of the control point [m].
        rolls: whether the vehicle does.

    """
    position, _, nu, _, water = state
    c_x, c_y, c_z = water
    if c_x or c_y or c_z:
        nu = over_ground(nu, rotation, water)
    euler = euler_from_rotation(rotation)
    if not rolls:
        euler = euler_without_roll(rotation)
    return PlantOutputs(
        euler,
        control_point(position, rotation, ell),
        control_point_velocity(rotation, nu, ell),
        nu,
    )


def white_noise(seed: int) -> Random:
    """The generator of the localisation system's noise, another one for each seed.

    Args:
        seed: any 32-bit integer. Random takes the magnitude of its seed.

    """
    return Random(seed % 2**32)


def measure(y: Vector3, n: Vector3, std: float) -> Vector3:
    """The localisation system: y with white noise.

    Args:
        y: control point [m], earth frame.
        n: three independent standard normal numbers.
        std: standard deviation of each axis [m]; not in the paper (reading 7).

    """
    return y[0] + std * n[0], y[1] + std * n[1], y[2] + std * n[2]
