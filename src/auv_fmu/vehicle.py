"""The underactuated vehicle with five degrees of freedom: equations (1) and (2)."""

from __future__ import annotations

from math import cos
from typing import NamedTuple

from auv_fmu.vectors import Vector3, Vector5


class Vehicle(NamedTuple):
    """Parameters of (2), with the values of section 4.1."""

    m11: float = 25.0  #: surge mass with added mass [kg]
    m22: float = 17.5  #: sway mass with added mass [kg]
    m33: float = 30.0  #: heave mass with added mass [kg]
    m55: float = 22.5  #: pitch inertia with added inertia [kg.m2]
    m66: float = 15.0  #: yaw inertia with added inertia [kg.m2]
    d11: float = 30.0  #: surge damping [kg/s]
    d22: float = 30.0  #: sway damping [kg/s]
    d33: float = 30.0  #: heave damping [kg/s]
    d55: float = 20.0  #: pitch damping [kg.m2/s]
    d66: float = 20.0  #: yaw damping [kg.m2/s]
    righting_pitch: float = 5.0  #: rho g nabla GM_L, righting moment in pitch [N.m]


def euler_rates(theta: float, q: float, r: float) -> tuple[float, float]:
    """Rates of pitch and yaw: T_2 of (1), for a vehicle whose roll is held at zero.

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
    """Body-fixed accelerations: equation (2).

    Args:
        vehicle: masses, damping and righting moment.
        nu: velocities (u, v, w, q, r) [m/s, rad/s], body frame.
        sin_theta: sine of the pitch angle; the righting moment acts on nothing else.
        tau: applied force and moments (tau_u, tau_q, tau_r) [N, N.m].
        tau_w: disturbance (u, v, w, q, r) [N, N.m]; it enters with a minus (reading 8).

    Returns:
        d/dt (u, v, w, q, r) [m/s2, rad/s2].

    """
    m11, m22, m33, m55, m66, d11, d22, d33, d55, d66, righting_pitch = vehicle
    u, v, w, q, r = nu
    tau_u, tau_q, tau_r = tau
    tau_wu, tau_wv, tau_ww, tau_wq, tau_wr = tau_w
    return (
        (m22 * v * r - m33 * w * q - d11 * u + tau_u - tau_wu) / m11,
        (-m11 * u * r - d22 * v - tau_wv) / m22,
        (m11 * u * q - d33 * w - tau_ww) / m33,
        ((m33 - m11) * u * w - d55 * q - righting_pitch * sin_theta + tau_q - tau_wq) / m55,
        ((m11 - m22) * u * v - d66 * r + tau_r - tau_wr) / m66,
    )
