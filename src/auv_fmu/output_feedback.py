"""The proposed controller: saturated output feedback, equations (16) to (24) and (48) to (51).

(16) to (24) are (48) to (51) with s = tanh, so the general form is written and the saturation
function is a parameter. Matrices of gains are diagonal and s acts component by component:
everything before the Jacobian is written for one axis of the control point.
"""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu.adaptation import bound, norm, regressor, robust_force, theta_hat_rate
from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import ELL, actuator_command
from auv_fmu.observer import (
    initial_dy_hat_o,
    observer_acceleration,
    observer_velocity,
    velocity_estimate,
)
from auv_fmu.saturation import Saturation, hyperbolic_tangent
from auv_fmu.types import Vector3, Vector4


class Gains(NamedTuple):
    """Parameters of (16) to (24), with the values of section 4.1."""

    K1: Vector3 = (10.0, 10.0, 10.0)  #: diagonal of K_1 [N]
    K2: Vector3 = (10.0, 10.0, 10.0)  #: diagonal of K_2 [N]
    lambda_: float = 1.0  #: Lambda = lambda I [m/s]
    k_d: float = 50.0  #: observer gain [1/s]
    gamma: float = 1.0  #: Gamma = gamma I
    sigma: float = 0.001  #: Sigma = sigma I [1/s]
    theta_0: Vector4 = (0.0, 0.0, 0.0, 0.0)  #: prior of the parameters [N, kg/s, kg/m, kg]
    eps_t: float = 1.0  #: width of the boundary layer [W]
    ell: float = ELL  #: distance of the control point [m]
    s: Saturation = hyperbolic_tangent  #: saturation function of Definition 2
    printed_jacobian: bool = False  #: (11) as printed, for zero roll (reading 3)
    innovation_gate: float = 1.0  #: largest credible |y - y_hat| [m], not in the paper; 0: none


class Measurement(NamedTuple):
    """What the controller is told. No velocity of the vehicle is in it."""

    y: Vector3  #: control point [m], earth frame
    euler: Vector3  #: roll, pitch, yaw of the vehicle [rad]
    y_d: Vector3  #: reference [m]
    dy_d: Vector3  #: its velocity [m/s]
    ddy_d: Vector3  #: its acceleration [m/s2]


class ControllerState(NamedTuple):
    """States of the observer and of the adaptive law."""

    y_hat: Vector3  #: estimated control point [m]
    dy_hat_o: Vector3  #: velocity of (23) and (24) [m/s]
    theta_hat: Vector4  #: estimated parameters [N, kg/s, kg/m, kg]


class Signals(NamedTuple):
    """Everything the law computes from a state and a measurement."""

    tau: Vector3  #: commanded (tau_u, tau_q, tau_r) [N, N.m]
    dy_hat: Vector3  #: estimated velocity of the control point [m/s]
    e: Vector3  #: tracking error y - y_d [m]
    z: Vector3  #: estimation error y - y_hat [m]
    ddy_hat_o: Vector3  #: rate of dy_hat_o [m/s2]
    dtheta_hat: Vector4  #: rate of theta_hat


def initial_state(gains: Gains, y: Vector3) -> ControllerState:
    """The initial conditions below (24): y_hat(0) = y(0), and theta_hat(0) = theta_0."""
    return ControllerState(y, _rest(gains, y, y), gains.theta_0)


def _rest(gains: Gains, y: Vector3, y_hat: Vector3) -> Vector3:
    z = (y[0] - y_hat[0], y[1] - y_hat[1], y[2] - y_hat[2])
    return (
        initial_dy_hat_o(gains.s(z[0])[0], z[0], gains.lambda_, gains.k_d),
        initial_dy_hat_o(gains.s(z[1])[0], z[1], gains.lambda_, gains.k_d),
        initial_dy_hat_o(gains.s(z[2])[0], z[2], gains.lambda_, gains.k_d),
    )


def gated(gains: Gains, state: ControllerState, y: Vector3) -> ControllerState:
    """The state, or a restarted observer if y is further from y_hat than a vehicle can move.

    Not in the paper. A host without an exchange of initial values hands the controller zeros
    in its first step; without the gate the observer would be kicked by k_d times the distance
    to the origin. theta_hat is kept.

    Args:
        gains: of the controller; `innovation_gate` [m] is the threshold, 0 turns it off.
        state: of the controller.
        y: new measurement of the control point [m].

    Returns:
        `state` itself when the measurement is credible.

    """
    y_hat = state.y_hat
    gate = gains.innovation_gate
    if not gate or norm((y[0] - y_hat[0], y[1] - y_hat[1], y[2] - y_hat[2])) <= gate:
        return state
    return ControllerState(y, _rest(gains, y, y), state.theta_hat)


def virtual_reference(dy_d: float, s_ez: float, lambda_: float) -> float:
    """dy_r/dt = dy_d/dt - Lambda s(e - z): equation (16), one axis.

    Args:
        dy_d: velocity of the reference [m/s].
        s_ez: s(e - z) = s(y_hat - y_d).
        lambda_: diagonal entry of Lambda [m/s].

    """
    return dy_d - lambda_ * s_ez


def axis(
    y: float,
    y_hat: float,
    dy_hat_o: float,
    y_d: float,
    dy_d: float,
    ddy_d: float,
    k1: float,
    k2: float,
    lambda_: float,
    k_d: float,
    s: Saturation,
) -> tuple[float, float, float, float, float, float, float]:
    """One axis of (16), (18), (21) without its last term, (23), (51) and Remark 3.

    Args:
        y, y_hat, y_d: measured, estimated and desired control point [m].
        dy_hat_o: observer state [m/s].
        dy_d, ddy_d: derivatives of the reference [m/s, m/s2].
        k1, k2: diagonal entries of K_1 and K_2 [N].
        lambda_, k_d, s: as in :class:`Gains`.

    Returns:
        (dy_hat, dy_r, ddy_r, r_hat, force, ddy_hat_o, z): the estimated velocity (23) [m/s], the
        virtual reference (16) [m/s] and its derivative (Remark 3) [m/s2], r_1 + r_2 with the
        estimated velocity (below (21)) [m/s], the first three terms of (21) [N], the observer
        acceleration (51) [m/s2] and the estimation error [m].

    """
    z = y - y_hat
    s_z, _ = s(z)
    s_ez, slope_ez = s(y_hat - y_d)
    dy_hat = velocity_estimate(dy_hat_o, s_z, z, lambda_, k_d)
    dy_r = virtual_reference(dy_d, s_ez, lambda_)
    ddy_r = ddy_d - lambda_ * slope_ez * (dy_hat - dy_d)
    r_hat = dy_hat - dy_d + lambda_ * s_ez + lambda_ * s_z
    dy_o = observer_velocity(dy_hat, s_z, lambda_)
    force = -k1 * s(dy_o - dy_r)[0] - k2 * s_ez - k2 * s_z
    return dy_hat, dy_r, ddy_r, r_hat, force, observer_acceleration(ddy_r, s_z, lambda_, k_d), z


def evaluate(gains: Gains, state: ControllerState, measurement: Measurement) -> Signals:
    """The control law at one instant: (16) to (24), or (48) to (51).

    Args:
        gains: of the controller.
        state: of observer and adaptive law.
        measurement: at the same instant.

    """
    K1, K2, lambda_, k_d, gamma, sigma, theta_0, eps_t, ell, s, printed_jacobian, _ = gains
    y, (phi, theta, psi), y_d, dy_d, ddy_d = measurement
    y_hat, dy_hat_o, theta_hat = state
    dy_hat0, dy_r0, ddy_r0, r0, f0, ddy_hat_o0, z0 = axis(
        y[0], y_hat[0], dy_hat_o[0], y_d[0], dy_d[0], ddy_d[0], K1[0], K2[0], lambda_, k_d, s
    )
    dy_hat1, dy_r1, ddy_r1, r1, f1, ddy_hat_o1, z1 = axis(
        y[1], y_hat[1], dy_hat_o[1], y_d[1], dy_d[1], ddy_d[1], K1[1], K2[1], lambda_, k_d, s
    )
    dy_hat2, dy_r2, ddy_r2, r2, f2, ddy_hat_o2, z2 = axis(
        y[2], y_hat[2], dy_hat_o[2], y_d[2], dy_d[2], ddy_d[2], K1[2], K2[2], lambda_, k_d, s
    )
    G = regressor((dy_r0, dy_r1, dy_r2), (ddy_r0, ddy_r1, ddy_r2))
    rho_hat = bound(G, theta_hat)
    force = (
        f0 - robust_force(rho_hat, r0, eps_t),
        f1 - robust_force(rho_hat, r1, eps_t),
        f2 - robust_force(rho_hat, r2, eps_t),
    )
    rotation = rotation_from_euler(0.0 if printed_jacobian else phi, theta, psi)
    return Signals(
        actuator_command(rotation, ell, force),
        (dy_hat0, dy_hat1, dy_hat2),
        (y[0] - y_d[0], y[1] - y_d[1], y[2] - y_d[2]),
        (z0, z1, z2),
        (ddy_hat_o0, ddy_hat_o1, ddy_hat_o2),
        theta_hat_rate(G, norm((r0, r1, r2)), theta_hat, theta_0, gamma, sigma),
    )


def step(state: ControllerState, signals: Signals, h: float) -> ControllerState:
    """One Euler step of observer (23), (51) and adaptive law (22).

    Args:
        state: at the beginning of the step.
        signals: evaluated there.
        h: step [s]; stable only while k_d h stays below 2, without ringing below 1.

    """
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2, c3) = state
    v0, v1, v2 = signals.dy_hat
    w0, w1, w2 = signals.ddy_hat_o
    g0, g1, g2, g3 = signals.dtheta_hat
    return ControllerState(
        (a0 + h * v0, a1 + h * v1, a2 + h * v2),
        (b0 + h * w0, b1 + h * w1, b2 + h * w2),
        (c0 + h * g0, c1 + h * g1, c2 + h * g2, c3 + h * g3),
    )
