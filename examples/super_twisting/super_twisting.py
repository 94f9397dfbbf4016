"""A super-twisting law: a sliding mode of second order, with a continuous command.

    s = de + c e,  e = y - y_d
    a = ddy_d - c de - k_1 |s|^(1/2) sign(s) + v,  dv/dt = -k_2 sign(s)
    F = M a + D dy, limited to what tau_max allows

M and D are mass and drag at the control point (`auv_fmu.paper.point_mass`). The rest of the forces
is a disturbance w [m/s2] of ds/dt = -k_1 |s|^(1/2) sign(s) + v + w. If |dw/dt| < L, and the gains
are large enough for L, s reaches zero in finite time, and stays there: Levant, Sliding order and
sliding accuracy in sliding mode control, International Journal of Control 58 (1993); Moreno and
Osorio, Strict Lyapunov functions for the super-twisting algorithm, IEEE Transactions on Automatic
Control 57 (2012). Usual gains are k_1 = 1.5 L^(1/2) and k_2 = 1.1 L (Shtessel et al., Sliding Mode
Control and Observation, 2014).

The law measures dy, and acts on each component of s in the earth frame. Along an axis of the body
whose force is at its limit, v does not grow. With the default inputs it rises to the limit.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector
from auv_fmu.paper.point_mass import (
    ZERO,
    Inputs,
    Outputs,
    PointMass,
    Triple,
    axes,
    command,
    limited,
    times,
    unwound,
)

SAMPLED = True
STOP_TIME = 10.0

#: Gains to tune, with their ranges.
GAINS = {"c": (0.2, 4.0), "L": (0.003, 10.0)}


class Parameters(NamedTuple):
    """Gains and vehicle."""

    c: Annotated[float, Variable("1/s", "Rate of the error while s is zero", POSITIVE)] = 0.7
    L: Annotated[float, Variable("m/s3", "Largest rate of the disturbance", POSITIVE)] = 0.1
    point: Annotated[PointMass, Variable(name="")] = PointMass()


class State(NamedTuple):
    """Memory of the law."""

    v: Triple  #: estimate of minus the disturbance [m/s2]


#: The force within its limits [N], what is missing of it, both in the body frame, and s [m/s].
Signals = tuple[Triple, Triple, Triple]


def start() -> State:
    """Return the state at the start."""
    return State(ZERO)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> Signals:
    """Return the signals."""
    c, k_1, point = parameters.c, 1.5 * sqrt(parameters.L), parameters.point
    de, R_T = inputs.dy - inputs.dy_d, axes(inputs.eta)
    s = de + c * (inputs.y - inputs.y_d)
    twist = Vector(copysign(k_1 * sqrt(abs(x)), x) for x in s)
    a = inputs.ddy_d - c * de - twist + state.v
    wanted = times(point.mass, R_T @ a) + times(point.drag, R_T @ inputs.dy)
    force = limited(point, wanted)
    return force, wanted - force, s


def update(
    parameters: Parameters, state: State, derived: Signals, inputs: Inputs, h: float
) -> State:
    """Return the state h seconds later."""
    k_2 = 1.1 * parameters.L
    rate = Vector(-copysign(k_2, x) if x != 0.0 else 0.0 for x in derived[2])
    return State(state.v + h * unwound(axes(inputs.eta), rate, derived[1]))


def outputs(parameters: Parameters, derived: Signals) -> Outputs:
    """Return the command."""
    return Outputs(command(parameters.point, derived[0]))
