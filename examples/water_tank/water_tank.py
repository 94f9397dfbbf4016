"""A tank with an inflow, a hole in its bottom, and a rim that it spills over.

    area dz/dt = inflow - hole sqrt(2 g z)

The outflow is Torricelli's law: water leaves a hole at the depth z as fast as if it had fallen from
the surface. `hole` is the area of the jet, which is about 0.6 of the area of a hole with a sharp
edge. The level is stepped by the explicit Euler rule.

With a constant inflow the level settles where both flows are equal: (inflow / hole)^2 / (2 g). If
that is above the rim, the tank overflows. With the default values the level rises from 0.2 m to
0.51 m. Close the inflow to see the tank run empty: the level is then a parabola of the time.

Look at `level` and `outflow`, and at `overflows` with an inflow of 0.008 m3/s.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable

GRAVITY = 9.81  #: [m/s2]

H_MAX, STEP_SIZE, STOP_TIME = 0.02, 1.0, 1000.0


class Parameters(NamedTuple):
    """The tank."""

    area: Annotated[float, Variable("m2", "Area of the surface", minimum=POSITIVE)] = 0.5
    hole: Annotated[float, Variable("m2", "Area of the jet", minimum=0.0, tunable=True)] = 0.001
    rim: Annotated[float, Variable("m", "Height of the rim", minimum=POSITIVE)] = 1.0
    level0: Annotated[float, Variable("m", "Level at the start", minimum=0.0)] = 0.2


class Inputs(NamedTuple):
    """Inflow."""

    inflow: Annotated[float, Variable("m3/s", "Flow into the tank", minimum=0.0)] = 0.00316


class State(NamedTuple):
    """Level."""

    level: Annotated[float, Variable("m", "Level above the hole")]


class Margins(NamedTuple):
    """Distances from the levels at which the equation switches."""

    rim: Annotated[float, Variable("m", "From the level to the rim")]


class Outputs(NamedTuple):
    """Outputs of the tank."""

    level: Annotated[float, Variable("m", "Level above the hole")]
    outflow: Annotated[float, Variable("m3/s", "Flow through the hole")]
    overflows: Annotated[bool, Variable("1", "The level is at the rim")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(min(parameters.level0, parameters.rim))


def derive(parameters: Parameters, state: State) -> float:
    """The flow through the hole [m3/s], by Torricelli's law."""
    return parameters.hole * sqrt(2 * GRAVITY * max(state.level, 0.0))


def update(parameters: Parameters, state: State, derived: float, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with a held inflow."""
    level = state.level + h * (inputs.inflow - derived) / parameters.area
    return State(min(max(level, 0.0), parameters.rim))


def rates(parameters: Parameters, state: State, derived: float, inputs: Inputs) -> State:
    """Rate of the level, which stops at the rim."""
    rate = (inputs.inflow - derived) / parameters.area
    return State(min(rate, 0.0) if state.level >= parameters.rim else rate)


def switches(parameters: Parameters, state: State) -> Margins:
    """Distance from the rim."""
    return Margins(parameters.rim - state.level)


def event(parameters: Parameters, state: State) -> State:
    """The state at an event: what is above the rim has spilled over."""
    return State(min(max(state.level, 0.0), parameters.rim))


def outputs(parameters: Parameters, state: State, derived: float) -> Outputs:
    """Outputs of the tank."""
    return Outputs(state.level, derived, state.level >= parameters.rim)
