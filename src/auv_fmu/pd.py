"""The baseline: adaptive robust PD control with measured velocity, equations (57) and (58)."""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu.adaptation import bound, norm, regressor, robust_force, theta_hat_rate
from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import ELL, actuator_command
from auv_fmu.types import Vector3, Vector4


class PdGains(NamedTuple):
    """Parameters of (57) and (58), with the values of section 4.1 (so section 4.2)."""

    K1: Vector3 = (10.0, 10.0, 10.0)  #: diagonal of K_1 [kg/s]
    lambda_: float = 1.0  #: Lambda = lambda I [1/s]
    gamma: float = 1.0  #: Gamma = gamma I
    sigma: float = 0.001  #: Sigma = sigma I [1/s]
    theta_0: Vector4 = (0.0, 0.0, 0.0, 0.0)  #: prior of the parameters [N, kg/s, kg/m, kg]
    eps_t: float = 1.0  #: width of the boundary layer [W]
    ell: float = ELL  #: distance of the control point [m]
    printed_jacobian: bool = False  #: (11) as printed, for zero roll (reading 3)


class PdMeasurement(NamedTuple):
    """What the controller is told: the velocity of the control point is in it."""

    y: Vector3  #: control point [m], earth frame
    euler: Vector3  #: roll, pitch, yaw of the vehicle [rad]
    y_d: Vector3  #: reference [m]
    dy_d: Vector3  #: its velocity [m/s]
    ddy_d: Vector3  #: its acceleration [m/s2]
    dy: Vector3  #: velocity of the control point [m/s]


class PdSignals(NamedTuple):
    """Everything the law computes from a state and a measurement."""

    tau: Vector3  #: commanded (tau_u, tau_q, tau_r) [N, N.m]
    e: Vector3  #: tracking error y - y_d [m]
    dtheta_hat: Vector4  #: rate of theta_hat


def evaluate(gains: PdGains, theta_hat: Vector4, measurement: PdMeasurement) -> PdSignals:
    """The control law (57) and the rate of its parameters (58).

    Args:
        gains: of the controller.
        theta_hat: estimated parameters [N, kg/s, kg/m, kg].
        measurement: at the same instant.

    """
    K1, lambda_, gamma, sigma, theta_0, eps_t, ell, printed_jacobian = gains
    y, (phi, theta, psi), y_d, dy_d, ddy_d, dy = measurement
    e0, e1, e2 = y[0] - y_d[0], y[1] - y_d[1], y[2] - y_d[2]
    r0 = dy[0] - dy_d[0] + lambda_ * e0
    r1 = dy[1] - dy_d[1] + lambda_ * e1
    r2 = dy[2] - dy_d[2] + lambda_ * e2
    G = regressor(dy_d, ddy_d)
    rho_hat = bound(G, theta_hat)
    force = (
        -K1[0] * r0 - robust_force(rho_hat, r0, eps_t),
        -K1[1] * r1 - robust_force(rho_hat, r1, eps_t),
        -K1[2] * r2 - robust_force(rho_hat, r2, eps_t),
    )
    rotation = rotation_from_euler(0.0 if printed_jacobian else phi, theta, psi)
    return PdSignals(
        actuator_command(rotation, ell, force),
        (e0, e1, e2),
        theta_hat_rate(G, norm((r0, r1, r2)), theta_hat, theta_0, gamma, sigma),
    )


def step(theta_hat: Vector4, signals: PdSignals, h: float) -> Vector4:
    """One Euler step of the adaptive law (58).

    Args:
        theta_hat: at the beginning of the step.
        signals: evaluated there.
        h: step [s].

    """
    g0, g1, g2, g3 = signals.dtheta_hat
    return (
        theta_hat[0] + h * g0,
        theta_hat[1] + h * g1,
        theta_hat[2] + h * g2,
        theta_hat[3] + h * g3,
    )
