"""An actuator with a limited rate, and backlash between its motor and its output.

    x follows u, by at most `rising` upwards and `falling` downwards in a second
    y = min(max(y, x - width / 2), x + width / 2)

The second line is the play operator, the usual model of backlash: the output rests while the motor
crosses the gap, and is then pushed by one of its sides. See G. Tao and P. V. Kokotovic, Adaptive
Control of Systems with Actuator and Sensor Nonlinearities, 1996.

So `y` depends on where `x` came from, not only on where it is. Backlash makes a loop with
integral action hunt: it oscillates around its set point.

With the default values the motor runs to 1, and the output lags by half a gap. Connect a
sine, and plot `y` over `u`: the loop is as wide as the gap.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable

STOP_TIME = 10.0


class Parameters(NamedTuple):
    """Limits and gap."""

    rising: Annotated[float, Variable("1/s", "Largest rate upwards", 0.0, tunable=True)] = 0.5
    falling: Annotated[float, Variable("1/s", "Largest rate downwards", 0.0, tunable=True)] = 0.5
    width: Annotated[float, Variable("1", "Width of the gap", 0.0, tunable=True)] = 0.1
    x0: Annotated[float, Variable("1", "Position at the start")] = 0.0


class Inputs(NamedTuple):
    """Command."""

    u: Annotated[float, Variable("1", "Commanded position")] = 1.0


class State(NamedTuple):
    """Positions of motor and output."""

    x: float  #: position of the motor
    y: float  #: position of the output


class Outputs(NamedTuple):
    """Positions of motor and output."""

    x: Annotated[float, Variable("1", "Position of the motor")]
    y: Annotated[float, Variable("1", "Position of the output")]


def start(parameters: Parameters) -> State:
    """State at the start, in the middle of the gap."""
    return State(parameters.x0, parameters.x0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with a held input."""
    x = state.x + min(max(inputs.u - state.x, -parameters.falling * h), parameters.rising * h)
    y = min(max(state.y, x - parameters.width / 2), x + parameters.width / 2)
    return State(x, y)


def outputs(state: State) -> Outputs:
    """Outputs of the actuator."""
    return Outputs(state.x, state.y)
