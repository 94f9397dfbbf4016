"""A direct model-reference adaptive law, which learns how mass and drag differ from the known ones.

    ddy_m = ddy_d - 2 zeta omega (dy_m - dy_d) - omega^2 (y_m - y_d)        reference model
    a = R' (ddy_m - 2 zeta omega (dy - dy_m) - omega^2 (y - y_m)),  v = R' dy
    f = M (a + Theta Phi) + D v, limited to what tau_max allows
    Phi = (v, |v| v, a, 1),  dTheta/dt = -gamma (s Phi + sigma Theta)
    s = R' ((dy - dy_m) + zeta omega (y - y_m))

M and D are mass and drag at the control point (`auv_fmu.paper.point_mass`), and Theta has a row for
each axis of the body. s is R' x'P B for the error x of the model, with A'P + P A = -2 zeta omega
diag(omega^2, 1). With the true masses M*, a constant Theta* and without sigma, V does not rise:

    V = x'P x + sum over the axes of M / M* |Theta - Theta*|^2 / gamma

See Lavretsky and Wise, Robust and Adaptive Control with Aerospace Applications (2013), chapter 9.
With noise, sigma keeps Theta bounded (chapter 11). An axis at its limit does not adapt. The law
measures dy.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector
from auv_fmu.paper.point_mass import (
    Inputs,
    Outputs,
    PointMass,
    Triple,
    axes,
    command,
    limited,
    times,
)

SAMPLED = True
STOP_TIME = 10.0

#: Gains to tune, with their ranges.
GAINS = {"omega": (0.2, 8.0), "gamma": (0.01, 10.0), "sigma": (0.001, 1.0)}


class Parameters(NamedTuple):
    """Gains and vehicle."""

    omega: Annotated[float, Variable("rad/s", "Frequency of model and error", POSITIVE)] = 1.0
    zeta: Annotated[float, Variable("1", "Damping of model and error", POSITIVE)] = 1.0
    gamma: Annotated[float, Variable("1/s2", "Gain of the adaptation", POSITIVE)] = 0.5
    sigma: Annotated[float, Variable("m/s", "Leak of the adaptation", 0.0)] = 0.01
    point: Annotated[PointMass, Variable(name="")] = PointMass()


class State(NamedTuple):
    """Position [m] and velocity [m/s] of the model, and what is learned; or the rates of these."""

    y_m: Triple
    dy_m: Triple
    Theta: Annotated[Matrix, 3, 4]


def start(inputs: Inputs) -> State:
    """Return the state at the start: the model is where the vehicle is."""
    return State(inputs.y, inputs.dy, Matrix((0.0 for _ in range(4)) for _ in range(3)))


def derive(parameters: Parameters, state: State, inputs: Inputs) -> tuple[Triple, State]:
    """The force [N] within its limits, in the body frame, and the rates of the state."""
    omega, zeta, gamma, sigma, point = parameters
    R_T, damping = axes(inputs.eta), 2.0 * zeta * omega
    e_m, de_m = state.y_m - inputs.y_d, state.dy_m - inputs.dy_d
    ddy_m = inputs.ddy_d - damping * de_m - omega * omega * e_m
    e, de = inputs.y - state.y_m, inputs.dy - state.dy_m
    a = R_T @ (ddy_m - damping * de - omega * omega * e)
    v, s = R_T @ inputs.dy, R_T @ (de + zeta * omega * e)
    Phi = Matrix((v[k], abs(v[k]) * v[k], a[k], 1.0) for k in range(3))
    more = Vector(state.Theta[k] @ Phi[k] for k in range(3))
    wanted = times(point.mass, a + more) + times(point.drag, v)
    force = limited(point, wanted)
    gain = Vector(-gamma if force[k] == wanted[k] else 0.0 for k in range(3))
    rate = Matrix(gain[k] * (s[k] * Phi[k] + sigma * state.Theta[k]) for k in range(3))
    return force, State(state.dy_m, ddy_m, rate)


def update(state: State, derived: tuple[Triple, State], h: float) -> State:
    """Return the state h seconds later."""
    dy_m, ddy_m, dTheta = derived[1]
    y_m = state.y_m + h * dy_m + 0.5 * h * h * ddy_m
    return State(y_m, state.dy_m + h * ddy_m, state.Theta + h * dTheta)


def outputs(parameters: Parameters, derived: tuple[Triple, State]) -> Outputs:
    """Return the command."""
    return Outputs(command(parameters.point, derived[0]))
