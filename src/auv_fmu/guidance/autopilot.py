"""Autopilots of speed, depth, pitch and heading, whose gains follow from stated poles.

Not in the paper. Each is designed for a linear model of its motion, on its own:

    speed:    m11 du/dt + d11 u + d11_quadratic |u| u = tau_u
    pitch:    m55 dq/dt + d55 q + righting sin(theta) = tau_q,  dtheta/dt = q
    heading:  m66 dr/dt + d66 r = tau_r,  dpsi/dt = r
    depth:    dz/dt = -u tan(theta), by the desired pitch

with natural frequency omega and damping ratio zeta. Pitch and heading have the PID law of
T. I. Fossen (2021), Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley, as
in `PIDpolePlacement` of PythonVehicleSimulator (lib/control.py, commit c717e07). Its integral gain
is omega / 10 of the gain of the angle. Two terms are added: the moment of the desired rate, and the
righting moment of the desired pitch. Without disturbance the poles are the roots of

    speed, depth:     s^2 + 2 zeta omega s + omega^2
    pitch, heading:   s^3 + 2 zeta omega s^2 + omega^2 s + omega^3 / 10

An integral rests while its command is beyond the limits and the error would drive it further.
"""

from __future__ import annotations

from enum import IntEnum
from math import atan2, sin
from typing import Annotated, NamedTuple

from auv_fmu.guidance.los import ssa
from auv_fmu.language.quantities import TAU
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.actuators import Limits, limit

#: Integral gain of pitch and heading, as a share of omega times the gain of the angle.
_SHARE = 0.1


class Vertical(IntEnum):
    """Quantity that the autopilot holds in the vertical plane."""

    DEPTH = 0
    PITCH = 1


class Model(NamedTuple):
    """The linear model, with the values of AuvPlant."""

    m11: Annotated[float, Variable("kg", "Surge mass with added mass", POSITIVE)] = 25.0
    m55: Annotated[float, Variable("kg.m2", "Pitch inertia with added inertia", POSITIVE)] = 22.5
    m66: Annotated[float, Variable("kg.m2", "Yaw inertia with added inertia", POSITIVE)] = 15.0
    d11: Annotated[float, Variable("kg/s", "Linear damping of surge", 0.0)] = 30.0
    d55: Annotated[float, Variable("kg.m2/s", "Linear damping of pitch", 0.0)] = 20.0
    d66: Annotated[float, Variable("kg.m2/s", "Linear damping of yaw", 0.0)] = 20.0
    d11_quadratic: Annotated[float, Variable("kg/m", "Quadratic damping of surge", 0.0)] = 0.0
    righting_pitch: Annotated[
        float,
        Variable("N.m", "Righting moment in pitch (rho g nabla GM_L)", name="righting.pitch"),
    ] = 5.0


class Poles(NamedTuple):
    """Natural frequency and damping ratio of a loop."""

    omega: Annotated[float, Variable("rad/s", "Natural frequency", POSITIVE, tunable=True)] = 1.0
    zeta: Annotated[float, Variable("1", "Damping ratio", 0.1, tunable=True)] = 1.0


class Parameters(NamedTuple):
    """All parameters of the autopilots."""

    model: Annotated[Model, Variable(name="")] = Model()
    speed: Poles = Poles(1.0)
    depth: Poles = Poles(0.1)
    pitch: Poles = Poles(2.0)
    heading: Poles = Poles(1.0)
    vertical: Annotated[Vertical, Variable("1", "Quantity that is held in the vertical plane")] = (
        Vertical.DEPTH
    )
    theta_max: Annotated[float, Variable("rad", "Largest desired pitch", POSITIVE, 1.5)] = 0.5
    limits: Annotated[Limits, Variable(name="")] = Limits()


class Measured(NamedTuple):
    """Depth, pitch and heading."""

    z: Annotated[float, Variable("m", "Depth")]
    theta: Annotated[float, Variable("rad", "Pitch")]
    psi: Annotated[float, Variable("rad", "Heading")]


class MeasuredMotion(NamedTuple):
    """Speed, and rates in the body frame."""

    u: Annotated[float, Variable("m/s", "Speed ahead")]
    q: Annotated[float, Variable("rad/s", "Pitch rate")]
    r: Annotated[float, Variable("rad/s", "Yaw rate")]


class Desired(NamedTuple):
    """Desired depth, pitch and heading."""

    z: Annotated[float, Variable("m", "Desired depth, used if depth is held")]
    theta: Annotated[float, Variable("rad", "Desired pitch, used if pitch is held")]
    psi: Annotated[float, Variable("rad", "Desired heading; the shorter way to it is taken")]


class DesiredMotion(NamedTuple):
    """Desired speed and rates."""

    u: Annotated[float, Variable("m/s", "Desired speed; a negative one counts as zero for depth")]
    q: Annotated[float, Variable("rad/s", "Rate of the desired pitch, used if pitch is held")]
    r: Annotated[float, Variable("rad/s", "Rate of the desired heading")]


class Inputs(NamedTuple):
    """Measured and desired motion."""

    eta: Measured
    nu: MeasuredMotion
    eta_d: Desired
    nu_d: DesiredMotion


class State(NamedTuple):
    """Integrals of the errors."""

    u: float  #: [m]
    z: float  #: [m.s]
    theta: float  #: [rad.s]
    psi: float  #: [rad.s]


class Gains(NamedTuple):
    """Gains of a law -(p e + i integral(e) + d de/dt)."""

    p: float
    i: float
    d: float


class Signals(NamedTuple):
    """Command, and rates of the integrals."""

    tau: Vector3  #: [N, N.m]
    theta_c: float  #: pitch that is held [rad]
    rates: State


def of_speed(model: Model, poles: Poles, u_d: float) -> Gains:
    """Gains of the speed, by the damping at the desired speed.

    Args:
        model: masses and damping.
        poles: of the loop.
        u_d: desired speed [m/s].

    """
    damping = model.d11 + 2.0 * model.d11_quadratic * abs(u_d)
    omega = poles.omega
    return Gains(2.0 * poles.zeta * omega * model.m11 - damping, model.m11 * omega * omega, 0.0)


def of_depth(poles: Poles) -> Gains:
    """Gains from the depth to the rate at which it falls [1/s, 1/s2, 1]."""
    return Gains(2.0 * poles.zeta * poles.omega, poles.omega * poles.omega, 0.0)


def of_angle(m: float, d: float, k: float, poles: Poles) -> Gains:
    """Gains of an angle with m dr/dt + d r + k angle = tau.

    Args:
        m: inertia [kg.m2].
        d: damping [kg.m2/s].
        k: stiffness [N.m].
        poles: of the loop.

    """
    omega = poles.omega
    stiffness = m * omega * omega
    return Gains(stiffness - k, _SHARE * omega * stiffness, 2.0 * poles.zeta * omega * m - d)


def growth(e: float, value: float, low: float, high: float, sign: float) -> float:
    """Rate of an integral of e: zero if its command is beyond a limit and e drives it further.

    Args:
        e: error.
        value: the command.
        low, high: its limits.
        sign: of the change of the command when the integral grows.

    """
    push = sign * e
    return 0.0 if (value > high and push > 0.0) or (value < low and push < 0.0) else e


def evaluate(parameters: Parameters, state: State, inputs: Inputs) -> Signals:
    """Command, and rates of the integrals.

    Args:
        parameters: of the autopilots.
        state: integrals of the errors.
        inputs: measured and desired motion.

    """
    model, (eta, nu, eta_d, nu_d) = parameters.model, inputs
    low, high = parameters.limits
    # Speed
    gains, e_u = of_speed(model, parameters.speed, nu_d.u), nu.u - nu_d.u
    drag = (model.d11 + model.d11_quadratic * abs(nu_d.u)) * nu_d.u
    tau_u = drag - gains.p * e_u - gains.i * state.u
    # Depth, by the pitch
    gains, e_z, most = of_depth(parameters.depth), eta.z - eta_d.z, parameters.theta_max
    theta_d, q_d, climbs = eta_d.theta, nu_d.q, 0.0
    if parameters.vertical == Vertical.DEPTH:
        theta_d = atan2(gains.p * e_z + gains.i * state.z, max(nu_d.u, 0.0))
        q_d, climbs = 0.0, growth(e_z, theta_d, -most, most, 1.0)
    theta_c = limit(theta_d, -most, most)
    # Pitch
    gains = of_angle(model.m55, model.d55, model.righting_pitch, parameters.pitch)
    e_theta, righting = eta.theta - theta_c, model.righting_pitch * sin(theta_c)
    tau_q = (
        righting + model.d55 * q_d
        - gains.p * e_theta - gains.i * state.theta - gains.d * (nu.q - q_d)
    )  # fmt: skip
    # Heading
    gains, e_psi = of_angle(model.m66, model.d66, 0.0, parameters.heading), ssa(eta.psi - eta_d.psi)
    tau_r = model.d66 * nu_d.r - gains.p * e_psi - gains.i * state.psi - gains.d * (nu.r - nu_d.r)
    return Signals(
        (tau_u, tau_q, tau_r),
        theta_c,
        State(
            growth(e_u, tau_u, low[0], high[0], -1.0),
            climbs,
            growth(e_theta, tau_q, low[1], high[1], -1.0),
            growth(e_psi, tau_r, low[2], high[2], -1.0),
        ),
    )


def step(state: State, rates: State, h: float) -> State:
    """Integrals after a step by Euler's scheme.

    Args:
        state: at its beginning.
        rates: of the integrals.
        h: step [s].

    """
    return State(
        state.u + h * rates.u,
        state.z + h * rates.z,
        state.theta + h * rates.theta,
        state.psi + h * rates.psi,
    )


class Outputs(NamedTuple):
    """The command, and the pitch that is held."""

    tau: Annotated[Vector3, Variable(TAU, "Commanded force and moments, not limited")]
    theta_c: Annotated[float, Variable("rad", "Pitch that is held, within its limits")]
