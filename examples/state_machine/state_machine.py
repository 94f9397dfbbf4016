"""The traffic light of a pedestrian crossing, as a state machine.

    GREEN -> AMBER -> RED -> RED_AMBER -> GREEN ...

The light is green for the cars until a pedestrian presses the button, and for `green` seconds at
least. It then runs through the other modes, each for the time of its parameter. A press of the
button is remembered, except while the cars have red. Pedestrians may walk while the cars have red.

A mode is a member of an `IntEnum`. As a parameter it is a text, such as `red`; as an output it is
its number. A mode changes at the end of a communication step, so a step should be short compared
with the times. The time by which it ends late counts towards the next mode, so errors do not add
up.

With the default values the button is held, and the light repeats itself every 22 s. Look at `mode`,
`walk` and `cycles`.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable

#: By how much a sum of steps may miss the end of a mode [s].
ROUNDING = 1e-9

STEP_SIZE, STOP_TIME = 0.1, 50.0


class Mode(IntEnum):
    """Signal for the cars."""

    GREEN = 0
    AMBER = 1
    RED = 2
    RED_AMBER = 3


class Parameters(NamedTuple):
    """Duration of each mode, and the first mode."""

    green: Annotated[float, Variable("s", "Least time of green", POSITIVE, tunable=True)] = 10.0
    amber: Annotated[float, Variable("s", "Time of amber", POSITIVE, tunable=True)] = 3.0
    red: Annotated[float, Variable("s", "Time of red", POSITIVE, tunable=True)] = 8.0
    red_amber: Annotated[float, Variable("s", "Time of red and amber", POSITIVE)] = 1.0
    first: Annotated[Mode, Variable("1", "Mode at the start")] = Mode.GREEN


class Inputs(NamedTuple):
    """Button for pedestrians."""

    button: Annotated[bool, Variable("1", "The button is pressed")] = True


class State(NamedTuple):
    """Mode, elapsed time and memory of the button."""

    mode: Mode
    elapsed: float  #: time in this mode [s]
    requested: bool  #: a pedestrian waits
    cycles: int


class Outputs(NamedTuple):
    """Outputs of the traffic light."""

    mode: Annotated[Mode, Variable("1", "Light for the cars")]
    walk: Annotated[bool, Variable("1", "Pedestrians may walk")]
    cycles: Annotated[int, Variable("1", "Full cycles")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.first, 0.0, False, 0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds, in which one mode may end."""
    mode, elapsed = state.mode, state.elapsed + h
    requested = state.requested or (inputs.button and mode != Mode.RED)
    after = state._replace(elapsed=elapsed, requested=requested)
    if mode == Mode.GREEN and requested and elapsed >= parameters.green - ROUNDING:
        # A request may come long after the least time of green.
        began = max(parameters.green, state.elapsed)
        after = after._replace(mode=Mode.AMBER, elapsed=elapsed - began)
    elif mode == Mode.AMBER and elapsed >= parameters.amber - ROUNDING:
        over = elapsed - parameters.amber
        after = after._replace(mode=Mode.RED, elapsed=over, requested=False)
    elif mode == Mode.RED and elapsed >= parameters.red - ROUNDING:
        after = after._replace(mode=Mode.RED_AMBER, elapsed=elapsed - parameters.red)
    elif mode == Mode.RED_AMBER and elapsed >= parameters.red_amber - ROUNDING:
        over = elapsed - parameters.red_amber
        after = after._replace(mode=Mode.GREEN, elapsed=over, cycles=state.cycles + 1)
    return after


def outputs(state: State) -> Outputs:
    """Outputs of the traffic light."""
    return Outputs(state.mode, state.mode == Mode.RED, state.cycles)
