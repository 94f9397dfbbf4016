"""The simulated vehicle with six degrees of freedom: section 4.1.

The controller is derived on five degrees of freedom; the paper simulates six and takes "the
roll interaction as an external disturbance". The plant does that to the letter: the terms that
roll adds to (2) enter through tau_w, so (2) stands once and is met exactly when p = 0
(reading 1).
"""

from __future__ import annotations

from random import Random
from typing import NamedTuple

from auv_fmu.actuators import Limits, limit_all
from auv_fmu.attitude import (
    euler_from_rotation,
    normalised,
    quaternion_from_euler,
    quaternion_rates,
    rotate,
    rotation_from_quaternion,
)
from auv_fmu.control_point import ELL, control_point, control_point_velocity
from auv_fmu.types import Rotation, Vector3, Vector4, Vector6
from auv_fmu.vehicle import Vehicle, accelerations

#: Initial posture of section 4.1: x, y, z [m], phi, theta, psi [rad]; it does not give phi.
ETA_0: Vector6 = (2.0, 6.0, 0.0, 0.0, 0.0, 0.0)

#: Initial velocity (u, v, w, p, q, r) [m/s, rad/s]: at rest, which section 4.1 does not say.
NU_0: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class RollAxis(NamedTuple):
    """What the sixth degree of freedom adds to :class:`~auv_fmu.vehicle.Vehicle`."""

    m44: float = 22.5  #: roll inertia with added inertia [kg.m2]
    d44: float = 20.0  #: roll damping [kg.m2/s]
    righting_roll: float = 5.0  #: righting moment in roll [N.m]; not in the paper (reading 1)


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


class PlantState(NamedTuple):
    """Motion of the vehicle."""

    position: Vector3  #: centre of mass (x, y, z) [m], earth frame
    quaternion: Vector4  #: attitude, body to earth, scalar first
    nu: Vector6  #: (u, v, w, p, q, r) [m/s, rad/s], body frame


class PlantOutputs(NamedTuple):
    """What can be seen of the vehicle."""

    euler: Vector3  #: roll, pitch, yaw [rad]
    y: Vector3  #: control point [m], earth frame, without measurement noise
    dy: Vector3  #: velocity of the control point [m/s], earth frame


def initial_state(position: Vector3, euler: Vector3, nu: Vector6) -> PlantState:
    """State at rest or in motion from the posture eta = (position, roll, pitch, yaw)."""
    return PlantState(position, quaternion_from_euler(*euler), nu)


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
    m44, d44, righting_roll = roll
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
    return du, dv, dw, dp, dq, dr


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
        tau: applied (tau_u, tau_q, tau_r), after the limits of (3) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        h: step [s].

    """
    (x, y, z), quaternion, nu = state
    u, v, w, p, q, r = nu
    du, dv, dw, dp, dq, dr = accelerations_6dof(vehicle, roll, nu, rotation, tau, tau_w)
    dx, dy, dz = rotate(rotation, (u, v, w))
    a, b, c, d = quaternion
    da, db, dc, dd = quaternion_rates(quaternion, (p, q, r))
    return PlantState(
        (x + h * dx, y + h * dy, z + h * dz),
        normalised((a + h * da, b + h * db, c + h * dc, d + h * dd)),
        (u + h * du, v + h * dv, w + h * dw, p + h * dp, q + h * dq, r + h * dr),
    )


def begin(parameters: Parameters) -> tuple[PlantState, Rotation]:
    """State at the start, and its attitude."""
    x, y, z, phi, theta, psi = parameters.eta0
    state = initial_state((x, y, z), (phi, theta, psi), parameters.nu0)
    return state, rotation_from_quaternion(state.quaternion)


def applied(parameters: Parameters, tau: Vector3) -> Vector3:
    """What the actuators make of a command (tau_u, tau_q, tau_r) [N, N.m]: equation (3)."""
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
        tau: applied (tau_u, tau_q, tau_r), after the limits of (3) [N, N.m].
        tau_w: disturbance (u, v, w, p, q, r) [N, N.m].
        h: step [s].
        n: how many.

    """
    while n > 0:
        state = step(parameters.vehicle, parameters.roll, state, rotation, tau, tau_w, h)
        rotation = rotation_from_quaternion(state.quaternion)
        n -= 1
    return state, rotation


def outputs(state: PlantState, rotation: Rotation, ell: float) -> PlantOutputs:
    """Euler angles, control point (9) and its velocity (10).

    Args:
        state: of the vehicle.
        rotation: body to earth, of its quaternion.
        ell: distance of the control point [m].

    """
    position, _, nu = state
    return PlantOutputs(
        euler_from_rotation(rotation),
        control_point(position, rotation, ell),
        control_point_velocity(rotation, nu, ell),
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
