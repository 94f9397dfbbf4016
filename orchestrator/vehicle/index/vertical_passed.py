"""When the pitch has passed 90 degrees, where (1) has a pole."""

from __future__ import annotations

from math import cos, isnan, nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable

#: A pitch [rad] whose cosine is positive, as that of any smaller one.
_UPRIGHT = 1.5


class Inputs(NamedTuple):
    """The pitch."""

    pitch: Annotated[float, Variable("rad", "Pitch", name="plant.eta.theta")]


class State(NamedTuple):
    """Of all rows so far."""

    upright: float  #: cosine of the pitch at the start
    passed: float  #: when [s]; not a number: not yet


class Outputs(NamedTuple):
    """The time."""

    vertical_passed: Annotated[float, Variable("s", "when the pitch had first passed 90 degrees")]


def start(inputs: Inputs, t: float) -> State:
    """The row of the start."""
    return update(State(cos(inputs.pitch), nan), inputs, t)


def update(state: State, inputs: Inputs, t: float) -> State:
    """One more row."""
    cosine = cos(inputs.pitch) if abs(inputs.pitch) > _UPRIGHT else 1.0
    if isnan(state.passed) and cosine * state.upright <= 0.0:
        return State(state.upright, t)
    return state


def outputs(state: State) -> Outputs:
    """The time."""
    return Outputs(state.passed)
