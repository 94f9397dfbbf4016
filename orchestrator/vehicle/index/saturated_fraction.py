"""Share of steps in which a command exceeds the limits of the actuators."""

from __future__ import annotations

from math import nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import TAU
from auv_fmu.language.vectors import Vector3


class Inputs(NamedTuple):
    """The commanded signal, and its limits."""

    command: Annotated[Vector3, Variable(TAU, "Commanded signal", name="plant.tau")]
    lower: Annotated[Vector3, Variable(TAU, "Lower limits of (3)", name="plant.tau_min")]
    upper: Annotated[Vector3, Variable(TAU, "Upper limits of (3)", name="plant.tau_max")]


class State(NamedTuple):
    """Counts over all steps so far."""

    outside: Vector3  #: number of steps outside the limits
    steps: int


class Outputs(NamedTuple):
    """The share."""

    saturated_fraction: Annotated[
        Vector3,
        Variable(dict.fromkeys(TAU, "1"), "share of the steps whose command is outside the limits"),
    ]


def start() -> State:
    """Begin without a step."""
    return State((0.0, 0.0, 0.0), 0)


def update(state: State, acting: Inputs) -> State:
    """Add a step."""
    u, q, r = state.outside
    if acting.command[0] < acting.lower[0] or acting.command[0] > acting.upper[0]:
        u += 1.0
    if acting.command[1] < acting.lower[1] or acting.command[1] > acting.upper[1]:
        q += 1.0
    if acting.command[2] < acting.lower[2] or acting.command[2] > acting.upper[2]:
        r += 1.0
    return State((u, q, r), state.steps + 1)


def outputs(state: State) -> Outputs:
    """Return the share, if there was a step."""
    if state.steps == 0:
        return Outputs((nan, nan, nan))
    u, q, r = state.outside
    return Outputs((u / state.steps, q / state.steps, r / state.steps))
