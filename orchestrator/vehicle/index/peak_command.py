"""Largest command of the controller."""

from __future__ import annotations

from math import nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import TAU
from auv_fmu.language.vectors import Vector3


class Inputs(NamedTuple):
    """The commanded signal."""

    command: Annotated[Vector3, Variable(TAU, "Commanded signal", name="plant.tau")]


class State(NamedTuple):
    """Largest values of all steps so far."""

    peak: Vector3  #: negative before the first step


class Outputs(NamedTuple):
    """The peak."""

    peak_command: Annotated[
        Vector3, Variable(TAU, "largest absolute value of the commanded signal")
    ]


def start() -> State:
    """Begin without a step."""
    return State((-1.0, -1.0, -1.0))


def update(state: State, acting: Inputs) -> State:
    """Add a step."""
    p_u, p_q, p_r = state.peak
    u, q, r = acting.command
    u, q, r = abs(u), abs(q), abs(r)
    if u <= p_u and q <= p_q and r <= p_r:
        return state
    return State((max(p_u, u), max(p_q, q), max(p_r, r)))


def outputs(state: State) -> Outputs:
    """Return the peak, if there was a step."""
    return Outputs(state.peak if state.peak[0] >= 0.0 else (nan, nan, nan))
