"""A PID law of the position: it follows a reference without a velocity sensor.

    e = y - y_d,  s = (dy - dy_d) / (1 + T_f p),  p = d/dt
    F = -K_p e - K_d s + M i, limited to what tau_max allows,  di/dt = -omega^2 / T_i e

Only y gives s: dy / (1 + T_f p) = (y - y_f) / T_f with T_f dy_f/dt = y - y_f. The gains place
the poles of a mass M with drag D (`auv_fmu.paper.point_mass`), as in Fossen, Handbook of Marine
Craft Hydrodynamics and Motion Control, 2021, section 15.3.4:

    K_p = omega^2 M,  K_d = 2 zeta omega M - D but not below 0,  T_i = 10 / omega

Along an axis whose force is at its limit, the integral does not grow further: it does not wind up
(conditional integration; Åström and Hägglund, PID Controllers: Theory, Design, and Tuning, 1995).
With the default inputs the vehicle does not move, and the integral rises to the limit.
"""

from __future__ import annotations

from math import expm1
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector
from auv_fmu.language.quantities import EULER, POSITION, VELOCITY
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.point_mass import (
    ZERO,
    Outputs,
    PointMass,
    Triple,
    axes,
    command,
    limited,
    times,
    unwound,
)

SAMPLED, STOP_TIME = True, 10.0

#: Gains to tune, with their ranges.
GAINS = {"omega": (0.2, 8.0), "zeta": (0.5, 2.0), "T_i": (2.0, 100.0), "T_f": (0.02, 0.5)}


class Parameters(NamedTuple):
    """Gains and vehicle."""

    omega: Annotated[float, Variable("rad/s", "Frequency of the error", POSITIVE)] = 1.0
    zeta: Annotated[float, Variable("1", "Damping of the error", 0.0)] = 1.0
    T_i: Annotated[float, Variable("s", "Integral time", POSITIVE)] = 10.0
    T_f: Annotated[float, Variable("s", "Time constant of the filter", POSITIVE)] = 0.1
    point: Annotated[PointMass, Variable(name="")] = PointMass()


class Inputs(NamedTuple):
    """Measurement and reference."""

    y: Annotated[Vector, 3, Variable(POSITION, "Measured control point")] = ZERO
    eta: Annotated[Vector3, Variable(EULER, "Measured Euler angle")] = (0.0, 0.0, 0.0)
    y_d: Annotated[Vector, 3, Variable(POSITION, "Desired control point")] = Vector((1.0, 0.0, 0.0))
    dy_d: Annotated[Vector, 3, Variable(VELOCITY, "Desired velocity")] = ZERO


class State(NamedTuple):
    """Memory: integral [m/s2], filtered position [m] and desired velocity [m/s]."""

    i: Triple
    y_f: Triple
    dy_f: Triple


def start(inputs: Inputs) -> State:
    """Return the state at the start, as at rest."""
    return State(ZERO, inputs.y, inputs.dy_d)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> tuple[Triple, Triple]:
    """The force [N] in the body frame within its limits, and what is missing of it."""
    omega, mass, drag = parameters.omega, parameters.point.mass, parameters.point.drag
    e, s = inputs.y - inputs.y_d, (inputs.y - state.y_f) / parameters.T_f - state.dy_f
    R_T = axes(inputs.eta)
    K_d = Vector(max(2.0 * parameters.zeta * omega * m - d, 0.0) for m, d in zip(mass, drag))
    wanted = times(mass, R_T @ (state.i - omega * omega * e)) - times(K_d, R_T @ s)
    force = limited(parameters.point, wanted)
    return force, wanted - force


def update(
    parameters: Parameters, state: State, derived: tuple[Triple, Triple], inputs: Inputs, h: float
) -> State:
    """Return the state h seconds later."""
    rate = -parameters.omega * parameters.omega / parameters.T_i * (inputs.y - inputs.y_d)
    i = state.i + h * unwound(axes(inputs.eta), rate, derived[1])
    share = -expm1(-h / parameters.T_f)
    y_f = state.y_f + share * (inputs.y - state.y_f)
    return State(i, y_f, state.dy_f + share * (inputs.dy_d - state.dy_f))


def outputs(parameters: Parameters, derived: tuple[Triple, Triple]) -> Outputs:
    """Return the command."""
    return Outputs(command(parameters.point, derived[0]))
