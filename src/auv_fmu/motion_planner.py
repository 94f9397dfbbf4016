"""The open-loop motion planner of Definition 1: (1) and (2) driven by constant torques.

The reference is the control point of a second, undisturbed vehicle whose roll is held at
zero. Its first two derivatives follow from the planner's own equations, without differences
of samples (reading 12).
"""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu.attitude import rotate, rotation_from_euler
from auv_fmu.control_point import control_point, control_point_velocity
from auv_fmu.types import Rotation, Vector3, Vector5
from auv_fmu.vehicle import Vehicle, accelerations, euler_rates

_UNDISTURBED = (0.0, 0.0, 0.0, 0.0, 0.0)


class PlannerState(NamedTuple):
    """Motion of the reference vehicle."""

    position: Vector3  #: centre of mass (x, y, z) [m], earth frame
    theta: float  #: pitch [rad]
    psi: float  #: yaw [rad]
    nu: Vector5  #: (u, v, w, q, r) [m/s, rad/s], body frame


class Reference(NamedTuple):
    """Desired trajectory of the control point, earth frame."""

    y_d: Vector3  #: [m]
    dy_d: Vector3  #: [m/s]
    ddy_d: Vector3  #: [m/s2]


def step(vehicle: Vehicle, state: PlannerState, tau_d: Vector3, h: float) -> PlannerState:
    """One Euler step of (1) and (2).

    Args:
        vehicle: parameters of the reference vehicle.
        state: at the beginning of the step.
        tau_d: (tau_ud, tau_qd, tau_rd) [N, N.m].
        h: step [s].

    Raises:
        ZeroDivisionError: the cosine of the pitch angle is exactly zero.

    """
    (x, y, z), theta, psi, (u, v, w, q, r) = state
    rotation = rotation_from_euler(0.0, theta, psi)
    dx, dy, dz = rotate(rotation, (u, v, w))
    dtheta, dpsi = euler_rates(theta, q, r)
    du, dv, dw, dq, dr = accelerations(vehicle, state.nu, -rotation[0][2], tau_d, _UNDISTURBED)
    return PlannerState(
        (x + h * dx, y + h * dy, z + h * dz),
        theta + h * dtheta,
        psi + h * dpsi,
        (u + h * du, v + h * dv, w + h * dw, q + h * dq, r + h * dr),
    )


def reference(vehicle: Vehicle, state: PlannerState, tau_d: Vector3, ell: float) -> Reference:
    """y_d, dy_d/dt and d2y_d/dt2 in closed form: (9), (10) and the derivative of (10).

    With a = (u, v + ell r, w - ell q) equation (10) reads dy = R a, and hence
    d2y = R (da/dt + omega x a). With roll held at zero R turns at omega = (-r tan(theta), q, r).

    Args:
        vehicle: parameters of the reference vehicle.
        state: of the reference vehicle.
        tau_d: (tau_ud, tau_qd, tau_rd) [N, N.m].
        ell: distance of the control point [m].

    """
    position, theta, psi, nu = state
    u, v, w, q, r = nu
    rotation: Rotation = rotation_from_euler(0.0, theta, psi)
    sin_theta = -rotation[0][2]
    du, dv, dw, dq, dr = accelerations(vehicle, nu, sin_theta, tau_d, _UNDISTURBED)
    a1, a2, a3 = u, v + ell * r, w - ell * q
    p = -r * sin_theta / rotation[2][2]
    return Reference(
        control_point(position, rotation, ell),
        control_point_velocity(rotation, (u, v, w, p, q, r), ell),
        rotate(
            rotation,
            (
                du + q * a3 - r * a2,
                dv + ell * dr + r * a1 - p * a3,
                dw - ell * dq + p * a2 - q * a1,
            ),
        ),
    )
