"""The baseline: adaptive robust PD control with measured velocity, equations (57) and (58)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.language.quantities import ACCELERATION, EULER, POSITION, VELOCITY, per_axis
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, Vector4, add_scaled, neg_diag, norm, sub
from auv_fmu.paper.adaptation import (
    Gamma,
    Layer,
    Prior,
    Sigma,
    bound,
    regressor,
    robust_force,
    theta_hat_rate,
)
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import ELL, Distance, WithoutRoll, actuator_command
from auv_fmu.paper.euler import advance_4


class PdGains(NamedTuple):
    """Parameters of (57) and (58), with the values of section 4.1 (so section 4.2)."""

    K1: Annotated[
        Vector3,
        Variable(
            per_axis("kg/s"),
            "Gain of the composite error on each axis (diagonal of K_1)",
            POSITIVE,
            tunable=True,
        ),
    ] = (10.0, 10.0, 10.0)
    lambda_: Annotated[
        float,
        Variable(
            "1/s",
            "Approach speed per position error on each axis (lambda)",
            POSITIVE,
            tunable=True,
            name="lambda",
        ),
    ] = 1.0
    gamma: Gamma = 1.0
    sigma: Sigma = 0.001
    theta_0: Prior = (0.0, 0.0, 0.0, 0.0)
    eps_t: Layer = 1.0
    ell: Distance = ELL
    printed_jacobian: WithoutRoll = False


class PdMeasurement(NamedTuple):
    """Inputs of the controller, among them the velocity of the control point."""

    y: Annotated[Vector3, Variable(POSITION, "Measured control point")]
    euler: Annotated[Vector3, Variable(EULER, "Measured Euler angle", name="eta")]
    y_d: Annotated[Vector3, Variable(POSITION, "Desired control point")]
    dy_d: Annotated[Vector3, Variable(VELOCITY, "Desired velocity")]
    ddy_d: Annotated[Vector3, Variable(ACCELERATION, "Desired acceleration")]
    dy: Annotated[Vector3, Variable(VELOCITY, "Measured velocity of the control point")]


class PdSignals(NamedTuple):
    """Results of the law for a state and a measurement."""

    tau: Vector3  #: commanded (tau_u, tau_q, tau_r) [N, N.m]
    e: Vector3  #: tracking error y - y_d [m]
    dtheta_hat: Vector4  #: rate of theta_hat


def evaluate(gains: PdGains, theta_hat: Vector4, measurement: PdMeasurement) -> PdSignals:
    """Equations (57) and (58): the control law and the rate of its parameters.

    Args:
        gains: of the controller.
        theta_hat: estimated parameters [N, kg/s, kg/m, kg].
        measurement: at the same instant.

    """
    y, (phi, theta, psi), y_d, dy_d, ddy_d, dy = measurement
    e = sub(y, y_d)
    r = add_scaled(sub(dy, dy_d), gains.lambda_, e)  # below (57): de + Lambda e
    G = regressor(dy_d, ddy_d)  # below (57)
    rho_hat = bound(G, theta_hat)  # below (57)
    F = sub(neg_diag(gains.K1, r), robust_force(rho_hat, r, gains.eps_t))  # bracket of (57)
    rotation = rotation_from_euler(0.0 if gains.printed_jacobian else phi, theta, psi)
    tau = actuator_command(rotation, F, gains.ell)  # (57), J^T F
    dtheta_hat = theta_hat_rate(
        G, norm(r), theta_hat, gains.theta_0, gains.gamma, gains.sigma
    )  # (58)
    return PdSignals(tau, e, dtheta_hat)


def step(theta_hat: Vector4, signals: PdSignals, h: float) -> Vector4:
    """One Euler step of the adaptive law (58).

    Args:
        theta_hat: at the beginning of the step.
        signals: evaluated there.
        h: step [s].

    """
    return advance_4(theta_hat, signals.dtheta_hat, h)
