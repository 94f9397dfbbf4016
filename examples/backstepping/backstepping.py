"""A backstepping law with integral action, by the adaptation of a constant disturbance.

    z_1 = y - y_d,  alpha = dy_d - k_1 z_1                      a virtual control of the position
    z_2 = dy - alpha
    a = dalpha/dt - k_1 k_2 z_1 - k_2 z_2 - w,  dw/dt = gamma z_2
    F = M a + D dy, limited to what tau_max allows

M and D are mass and drag at the control point (`auv_fmu.paper.point_mass`), and w [m/s2] estimates
the other forces. If these are constant, the energy of errors and estimate cannot rise:

    V = k_1 k_2 z_1'z_1 / 2 + z_2'z_2 / 2 + (w - w*)'(w - w*) / (2 gamma)
    dV/dt = -k_1^2 k_2 z_1'z_1 - k_2 z_2'z_2

See Krstić, Kanellakopoulos and Kokotović, Nonlinear and Adaptive Control Design (1995), and Fossen,
Handbook of Marine Craft Hydrodynamics and Motion Control (2011). The former weigh z_1'z_1 with one.

The law measures dy. Along an axis of the body whose force is at its limit, w does not grow. With
the default inputs the force rises to the limit.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable
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
GAINS = {"k_1": (0.2, 5.0), "k_2": (0.2, 10.0), "gamma": (0.01, 10.0)}


class Parameters(NamedTuple):
    """Gains and vehicle."""

    k_1: Annotated[float, Variable("1/s", "Rate of the position", POSITIVE)] = 0.7
    k_2: Annotated[float, Variable("1/s", "Rate of the velocity", POSITIVE)] = 1.0
    gamma: Annotated[float, Variable("1/s2", "Gain of the adaptation", POSITIVE)] = 0.2
    point: Annotated[PointMass, Variable(name="")] = PointMass()


class State(NamedTuple):
    """Memory of the law."""

    w: Triple  #: estimate of the disturbance [m/s2]


#: The force within its limits [N], what is missing of it, both in the body frame, and z_2 [m/s].
Signals = tuple[Triple, Triple, Triple]


def start() -> State:
    """Return the state at the start."""
    return State(ZERO)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> Signals:
    """Return the signals."""
    k_1, k_2, _, point = parameters
    z_1, de, R_T = inputs.y - inputs.y_d, inputs.dy - inputs.dy_d, axes(inputs.eta)
    z_2 = de + k_1 * z_1
    a = inputs.ddy_d - k_1 * de - k_1 * k_2 * z_1 - k_2 * z_2 - state.w
    wanted = times(point.mass, R_T @ a) + times(point.drag, R_T @ inputs.dy)
    force = limited(point, wanted)
    return force, wanted - force, z_2


def update(
    parameters: Parameters, state: State, derived: Signals, inputs: Inputs, h: float
) -> State:
    """Return the state h seconds later."""
    rate = unwound(axes(inputs.eta), -parameters.gamma * derived[2], derived[1])
    return State(state.w - h * rate)


def outputs(parameters: Parameters, derived: Signals) -> Outputs:
    """Return the command."""
    return Outputs(command(parameters.point, derived[0]))
