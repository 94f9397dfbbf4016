"""A counter that rises by one every second, up to ten.

It shows how a component reacts to points in time. A step may be shorter or longer than a second, so
`update` counts all the seconds that have passed at its end. A step that ends within rounding of a
full second counts it.

This is the model Stair of the Reference FMUs of the Modelica Association. Theirs ends the run when
the counter reaches ten; this one stays there. Up to then, `counter` is the same.

Look at `counter` with communication steps of 0.2 s and of 3 s.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable

#: By how much a sum of steps may miss a full second [s].
ROUNDING = 1e-5

STEP_SIZE, STOP_TIME = 0.2, 10.0


class Parameters(NamedTuple):
    """First and last value."""

    start: Annotated[int, Variable("1", "Value at the start", minimum=0)] = 1
    limit: Annotated[int, Variable("1", "Value that it stays at", minimum=0)] = 10


class State(NamedTuple):
    """Count, and time of the next one."""

    counter: int
    next_event: float  #: when it rises next [s]


class Outputs(NamedTuple):
    """Outputs of the counter."""

    counter: Annotated[int, Variable("1", "Value of the counter")]


def start(parameters: Parameters, t: float) -> State:
    """State at the start."""
    return State(parameters.start, t + 1.0)


def update(parameters: Parameters, state: State, t: float, h: float) -> State:
    """State after a step of h seconds."""
    counter, next_event = state.counter, state.next_event
    while t + h >= next_event - ROUNDING and counter < parameters.limit:
        counter += 1
        next_event += 1.0
    return State(counter, next_event)


def outputs(state: State) -> Outputs:
    """Outputs of the counter."""
    return Outputs(state.counter)
