"""The baseline: adaptive robust PD control with measured velocity, equations (57) and (58)."""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu.adaptation import bound, regressor, robust_force, theta_hat_rate
from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import ELL, actuator_command
from auv_fmu.euler import advance_4
from auv_fmu.vectors import Vector3, Vector4, difference, minus_product, norm, plus_scaled


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
    e = difference(y, y_d)
    r = plus_scaled(difference(dy, dy_d), lambda_, e)  # below (57): de + Lambda e
    G = regressor(dy_d, ddy_d)  # below (57)
    rho_hat = bound(G, theta_hat)  # below (57)
    F = difference(minus_product(K1, r), robust_force(rho_hat, r, eps_t))  # bracket of (57)
    rotation = rotation_from_euler(0.0 if printed_jacobian else phi, theta, psi)
    tau = actuator_command(rotation, F, ell)  # (57), J^T F
    dtheta_hat = theta_hat_rate(G, norm(r), theta_hat, theta_0, gamma, sigma)  # (58)
    return PdSignals(tau, e, dtheta_hat)


def step(theta_hat: Vector4, signals: PdSignals, h: float) -> Vector4:
    """One Euler step of the adaptive law (58).

    Args:
        theta_hat: at the beginning of the step.
        signals: evaluated there.
        h: step [s].

    """
    return advance_4(theta_hat, signals.dtheta_hat, h)


def steps(
    gains: PdGains,
    theta_hat: Vector4,
    signals: PdSignals,
    measurement: PdMeasurement,
    h: float,
    n: int,
) -> Vector4:
    """theta_hat after n steps of h seconds under a held measurement.

    Args:
        gains: of the controller.
        theta_hat, signals: at the beginning.
        measurement: held.
        h: step [s].
        n: how many, one at least.

    """
    theta_hat = step(theta_hat, signals, h)
    while n > 1:
        theta_hat = step(theta_hat, evaluate(gains, theta_hat, measurement), h)
        n -= 1
    return theta_hat
