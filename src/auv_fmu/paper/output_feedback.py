"""The proposed controller: saturated output feedback, equations (16) to (24) and (48) to (51).

Theorem 2 restates (21) to (24) as (48) to (51) with a general saturation function s in place of
Tanh. The code has the general form, with s as a parameter. All matrices of gains are diagonal.
:func:`evaluate` is the law, line by line in the order of computation.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.language.quantities import ACCELERATION, EULER, POSITION, VELOCITY, per_axis
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import (
    Vector3,
    Vector4,
    add,
    add_scaled,
    add_two_scaled,
    distance,
    neg_diag,
    norm,
    scale,
    sub,
    sub_diag,
    sub_scaled,
)
from auv_fmu.paper import observer
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
from auv_fmu.paper.observer import EXACT, INTEGRAL, Form
from auv_fmu.paper.saturation import Saturation, saturation, slope


class Gains(NamedTuple):
    """Parameters of (16) to (24), with the values of section 4.1."""

    K1: Annotated[
        Vector3,
        Variable(
            per_axis("N"),
            "Gain of the velocity error on each axis (diagonal of K_1)",
            POSITIVE,
            tunable=True,
        ),
    ] = (10.0, 10.0, 10.0)
    K2: Annotated[
        Vector3,
        Variable(
            per_axis("N"),
            "Gain of the position error on each axis (diagonal of K_2)",
            POSITIVE,
            tunable=True,
        ),
    ] = (10.0, 10.0, 10.0)
    lambda_: Annotated[
        float,
        Variable(
            "m/s",
            "Bound of the approach speed on each axis (lambda)",
            POSITIVE,
            tunable=True,
            name="lambda",
        ),
    ] = 1.0
    k_d: Annotated[float, Variable("1/s", "Gain of the observer (k_d)", POSITIVE, tunable=True)] = (
        50.0
    )
    gamma: Gamma = 1.0
    sigma: Sigma = 0.001
    theta_0: Prior = (0.0, 0.0, 0.0, 0.0)
    eps_t: Layer = 1.0
    ell: Distance = ELL
    s: Annotated[
        Saturation,
        Variable(
            "1",
            "Saturation function of Definition 2: tanh, algebraic or arctan",
            name="saturation",
        ),
    ] = Saturation.TANH
    printed_jacobian: WithoutRoll = False
    innovation_gate: Annotated[
        float,
        Variable(
            "m",
            "Restart the observer when |y - y_hat| exceeds this; 0: never. Not in the paper",
            0.0,
            tunable=True,
        ),
    ] = 1.0
    form: Annotated[
        Form,
        Variable(
            "1",
            "Form of the observer: (51) by Euler's scheme (euler), with k_d exact over a step "
            "(exact), or (24) as printed (integral)",
            name="observer",
        ),
    ] = Form.EULER


class Measurement(NamedTuple):
    """Inputs of the controller, without any velocity of the vehicle."""

    y: Annotated[Vector3, Variable(POSITION, "Measured control point")]
    euler: Annotated[Vector3, Variable(EULER, "Measured Euler angle", name="eta")]
    y_d: Annotated[Vector3, Variable(POSITION, "Desired control point")]
    dy_d: Annotated[Vector3, Variable(VELOCITY, "Desired velocity")]
    ddy_d: Annotated[Vector3, Variable(ACCELERATION, "Desired acceleration")]


class ControllerState(NamedTuple):
    """States of the observer and of the adaptive law."""

    y_hat: Vector3  #: estimated control point [m]
    dy_hat_o: Vector3  #: dy_hat_o of (23), (24) or the integral [m/s]; not dy_o (reading 15)
    theta_hat: Vector4  #: estimated parameters [N, kg/s, kg/m, kg]
    h: float  #: length of the last step [s]; 0 before the first


class Signals(NamedTuple):
    """Results of the law for a state and a measurement."""

    tau: Vector3  #: commanded (tau_u, tau_q, tau_r) [N, N.m]
    dy_hat: Vector3  #: estimated velocity of the control point [m/s]
    e: Vector3  #: tracking error y - y_d [m]
    z: Vector3  #: estimation error y - y_hat [m]
    ddy_hat_o: Vector3  #: rate of the state dy_hat_o [m/s2]
    dtheta_hat: Vector4  #: rate of theta_hat


def initial_state(gains: Gains, y: Vector3) -> ControllerState:
    """Initial conditions below (24): y_hat(0) = y(0), and theta_hat(0) = theta_0."""
    y_hat = y
    z = sub(y, y_hat)
    dy_hat_o = observer.initial_dy_hat_o(saturation(gains.s, z), z, gains.lambda_, gains.k_d)
    return ControllerState(y_hat, dy_hat_o, gains.theta_0, 0.0)


def credible(gains: Gains, state: ControllerState, y: Vector3) -> bool:
    """True if the vehicle can have moved to a measured position. Not in the paper.

    Args:
        gains: of the controller; `innovation_gate` [m] is the threshold, 0 turns it off.
        state: of the controller.
        y: new measurement of the control point [m].

    """
    gate = gains.innovation_gate
    return not gate or distance(y, state.y_hat) <= gate


def restarted(gains: Gains, state: ControllerState, y: Vector3) -> ControllerState:
    """State with the observer restarted at a measurement that is not credible.

    Not in the paper. Hosts that do not exchange initial values pass zeros to the controller in the
    first step; without a restart the estimated velocity would jump by k_d times the distance to the
    origin. theta_hat is kept.

    Args:
        gains: of the controller.
        state: of the controller.
        y: new measurement of the control point [m].

    """
    fresh = initial_state(gains, y)
    return ControllerState(fresh.y_hat, fresh.dy_hat_o, state.theta_hat, state.h)


def gated(gains: Gains, state: ControllerState, y: Vector3) -> ControllerState:
    """State, with a restarted observer if the measurement y [m] is not credible."""
    return state if credible(gains, state, y) else restarted(gains, state, y)


def evaluate(gains: Gains, state: ControllerState, measurement: Measurement, h: float) -> Signals:
    """Equations (16) to (24), or (48) to (51): the control law at one instant.

    Args:
        gains: of the controller.
        state: of observer and adaptive law.
        measurement: at the same instant.
        h: length of the step that begins there [s], for the gain of an `exact` observer; 0: none.

    """
    K2, lambda_, k_d, s = gains.K2, gains.lambda_, gains.k_d, gains.s
    y, (phi, theta, psi), y_d, dy_d, ddy_d = measurement
    y_hat, dy_hat_o, theta_hat, _ = state
    if gains.form == EXACT and h:
        k_d = observer.exact_gain(k_d, h)
    e, z = sub(y, y_d), sub(y, y_hat)  # above (16)
    e_z = sub(y_hat, y_d)  # e - z
    s_z, s_ez = saturation(s, z), saturation(s, e_z)
    dy_r = sub_scaled(dy_d, lambda_, s_ez)  # (16): dy_d - Lambda s(e - z)
    if gains.form == INTEGRAL:
        dy_hat_o = add(dy_r, dy_hat_o)  # (24) as printed: dy_r + k_d Lambda int s(z)
    dy_hat = add_two_scaled(dy_hat_o, lambda_, s_z, k_d, z)  # (23)
    dy_o = sub_scaled(dy_hat, lambda_, s_z)  # (18): dy_hat - Lambda s(z)
    de = sub(dy_hat, dy_d)
    ddy_r = sub_diag(ddy_d, scale(lambda_, slope(s, e_z, s_ez)), de)  # Remark 3
    r_hat_sum = add_two_scaled(de, lambda_, s_ez, lambda_, s_z)  # below (21)
    G = regressor(dy_r, ddy_r)  # below (20)
    rho_hat = bound(G, theta_hat)  # below (21)
    robust = robust_force(rho_hat, r_hat_sum, gains.eps_t)  # last term of (21)
    s_dy = saturation(s, sub(dy_o, dy_r))
    # Bracket of (21): F = -K_1 s(dy_o - dy_r) - K_2 s(e - z) - K_2 s(z) - robust
    F = sub_diag(sub_diag(neg_diag(gains.K1, s_dy), K2, s_ez), K2, s_z)
    F = sub(F, robust)
    rotation = rotation_from_euler(0.0 if gains.printed_jacobian else phi, theta, psi)  # reading 3
    tau = actuator_command(rotation, F, gains.ell)  # (21), J^T F
    dtheta_hat = theta_hat_rate(
        G, norm(r_hat_sum), theta_hat, gains.theta_0, gains.gamma, gains.sigma
    )  # (22)
    ddy_hat_o = observer.rate(gains.form, ddy_r, s_z, lambda_, k_d)  # (51), for (24): reading 4
    return Signals(tau, dy_hat, e, z, ddy_hat_o, dtheta_hat)


def step(state: ControllerState, signals: Signals, h: float) -> ControllerState:
    """One Euler step of observer (23), (51) and adaptive law (22).

    Args:
        state: at the beginning of the step.
        signals: evaluated there, for a step of this length.
        h: step [s]; `observer_rate` of :mod:`auv_fmu.proof.gain_conditions` limits k_d for it.

    """
    return ControllerState(
        add_scaled(state.y_hat, h, signals.dy_hat),
        add_scaled(state.dy_hat_o, h, signals.ddy_hat_o),
        advance_4(state.theta_hat, signals.dtheta_hat, h),
        h,
    )
