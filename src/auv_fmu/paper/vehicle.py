"""The underactuated vehicle with five degrees of freedom: equations (1) and (2)."""

from __future__ import annotations

from math import cos
from typing import Annotated, NamedTuple

from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, Vector5


class Vehicle(NamedTuple):
    """Parameters of (2), with the values of section 4.1."""

    m11: Annotated[float, Variable("kg", "Surge mass with added mass", POSITIVE)] = 25.0
    m22: Annotated[float, Variable("kg", "Sway mass with added mass", POSITIVE)] = 17.5
    m33: Annotated[float, Variable("kg", "Heave mass with added mass", POSITIVE)] = 30.0
    m55: Annotated[float, Variable("kg.m2", "Pitch inertia with added inertia", POSITIVE)] = 22.5
    m66: Annotated[float, Variable("kg.m2", "Yaw inertia with added inertia", POSITIVE)] = 15.0
    d11: Annotated[float, Variable("kg/s", "Linear damping of surge", 0.0)] = 30.0
    d22: Annotated[float, Variable("kg/s", "Linear damping of sway", 0.0)] = 30.0
    d33: Annotated[float, Variable("kg/s", "Linear damping of heave", 0.0)] = 30.0
    d55: Annotated[float, Variable("kg.m2/s", "Linear damping of pitch", 0.0)] = 20.0
    d66: Annotated[float, Variable("kg.m2/s", "Linear damping of yaw", 0.0)] = 20.0
    righting_pitch: Annotated[
        float,
        Variable("N.m", "Righting moment in pitch (rho g nabla GM_L)", name="righting.pitch"),
    ] = 5.0


def euler_rates(theta: float, q: float, r: float) -> tuple[float, float]:
    """T_2 of (1): rates of pitch and yaw of a vehicle whose roll is held at zero.

    Args:
        theta: pitch angle [rad]; the yaw rate has a pole at +-pi/2.
        q, r: pitch and yaw rate in the body frame [rad/s].

    Returns:
        (d theta/dt, d psi/dt) [rad/s].

    Raises:
        ZeroDivisionError: cos(theta) is exactly zero.

    """
    return q, r / cos(theta)


def accelerations(
    vehicle: Vehicle, nu: Vector5, sin_theta: float, tau: Vector3, tau_w: Vector5
) -> Vector5:
    """Equation (2): body-fixed accelerations.

    Args:
        vehicle: masses, damping and righting moment.
        nu: velocities (u, v, w, q, r) [m/s, rad/s], body frame.
        sin_theta: sine of the pitch angle, for the righting moment.
        tau: applied force and moments (tau_u, tau_q, tau_r) [N, N.m].
        tau_w: disturbance (u, v, w, q, r) [N, N.m]; it enters with a minus (reading 8).

    Returns:
        d/dt (u, v, w, q, r) [m/s2, rad/s2].

    """
    m11, m22, m33 = vehicle.m11, vehicle.m22, vehicle.m33
    righting = vehicle.righting_pitch * sin_theta
    u, v, w, q, r = nu
    tau_u, tau_q, tau_r = tau
    tau_wu, tau_wv, tau_ww, tau_wq, tau_wr = tau_w
    return (
        (m22 * v * r - m33 * w * q - vehicle.d11 * u + tau_u - tau_wu) / m11,
        (-m11 * u * r - vehicle.d22 * v - tau_wv) / m22,
        (m11 * u * q - vehicle.d33 * w - tau_ww) / m33,
        ((m33 - m11) * u * w - vehicle.d55 * q - righting + tau_q - tau_wq) / vehicle.m55,
        ((m11 - m22) * u * v - vehicle.d66 * r + tau_r - tau_wr) / vehicle.m66,
    )
