"""Time after which the control point stays close to its reference."""

from __future__ import annotations

from math import isnan, nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.vectors import norm
from orchestrator.vehicle.index.tracking import REACHED, Inputs, error


class State(NamedTuple):
    """Result of all rows so far."""

    settled: float  #: time of the first row of those near the reference [s]; not a number elsewhere


class Outputs(NamedTuple):
    """Time."""

    time_to_settle: Annotated[
        float,
        Variable(
            "s",
            f"time from the start of the run until |e| is at most {REACHED:g} m for the rest of it",
        ),
    ]


def start(inputs: Inputs, t: float, begin: float) -> State:
    """Begin with the first row."""
    return update(State(nan), inputs, t, begin)


def update(state: State, inputs: Inputs, t: float, begin: float) -> State:
    """Add a row."""
    if norm(error(inputs)) > REACHED:
        return State(nan)
    return State(t - begin) if isnan(state.settled) else state


def outputs(state: State) -> Outputs:
    """Return the time."""
    return Outputs(state.settled)
