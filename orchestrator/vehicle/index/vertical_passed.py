"""Time at which the pitch passes 90 degrees, where (1) without roll has a pole."""

from __future__ import annotations

from math import cos, isnan, nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable

#: A pitch below 90 degrees [rad]: cosines of smaller ones need not be computed.
_UPRIGHT = 1.5


class Inputs(NamedTuple):
    """The pitch, and whether the vehicle rolls."""

    pitch: Annotated[float, Variable("rad", "Pitch", name="plant.eta.theta")]
    roll: Annotated[bool, Variable(description="Rolls or not", name="plant.roll")]


class State(NamedTuple):
    """Results of all rows so far."""

    upright: float  #: cosine of the pitch at the start
    passed: float  #: time [s]; not a number before it


class Outputs(NamedTuple):
    """The time."""

    vertical_passed: Annotated[float, Variable("s", "when the pitch had first passed 90 degrees")]


def start(inputs: Inputs, t: float) -> State:
    """Begin with the first row."""
    return update(State(cos(inputs.pitch), nan), inputs, t)


def update(state: State, inputs: Inputs, t: float) -> State:
    """Add a row."""
    cosine = cos(inputs.pitch) if abs(inputs.pitch) > _UPRIGHT else 1.0
    if not inputs.roll and isnan(state.passed) and cosine * state.upright <= 0.0:
        return State(state.upright, t)
    return state


def outputs(state: State) -> Outputs:
    """Return the time."""
    return Outputs(state.passed)
