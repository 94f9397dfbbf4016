"""A sensor with dead time, lag and noise, such as a thermometer at the end of a pipe.

    T dx/dt = u(t - delay) - x,  y = x + noise

The dead time is a delay line of 50 cells, used as a ring. At the end of each fiftieth of the delay
the value of the oldest cell leaves the line, and the current input takes its place. So the delay is
exact within one cell, or within a step if that is longer. The lag is solved exactly for the value
that leaves the line.

`measured` adds the noise to `y`, from the standard normal number `n`, drawn once in each
communication step. The same `seed` gives the same noise in each run.

Lag with dead time is the standard model of slow processes; see Åström and Hägglund, Advanced PID
Control. With the default values a step from 20 to 80 degC arrives after 2 s, and `y` has passed
63 % of it after 5 s. Look at `x` and `y`.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector

CELLS = 50

STOP_TIME = 20.0


class Parameters(NamedTuple):
    """The sensor."""

    delay: Annotated[float, Variable("s", "Dead time", minimum=POSITIVE)] = 2.0
    T: Annotated[float, Variable("s", "Time constant", minimum=POSITIVE, tunable=True)] = 3.0
    start: Annotated[float, Variable("degC", "Temperature before the start")] = 20.0
    std: Annotated[float, Variable("K", "Standard deviation of the noise", minimum=0.0)] = 0.2
    seed: Annotated[int, Variable("1", "Seed of the noise")] = 1


class Inputs(NamedTuple):
    """Measured quantity."""

    u: Annotated[float, Variable("degC", "Temperature")] = 80.0


class State(NamedTuple):
    """Values in the delay line, and the lag."""

    line: Annotated[Vector, CELLS]  #: temperatures in the pipe [degC]
    oldest: int  #: place of the oldest of them
    age: float  #: time since a cell was filled [s]
    x: float  #: temperature of the sensor [degC]


class Outputs(NamedTuple):
    """Outputs of the sensor."""

    x: Annotated[float, Variable("degC", "Temperature of the sensor")]
    y: Annotated[float, Variable("degC", "Measured temperature")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    start = parameters.start
    return State(Vector(start for _ in range(CELLS)), 0, 0.0, start)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with a held input."""
    line, oldest, age = state.line, state.oldest, state.age + h
    leaving = line[oldest]
    period = parameters.delay / CELLS
    for _ in range(CELLS):
        if age < period * (1 - 1e-9):
            break
        age -= period
        leaving = line[oldest]
        line = line.replaced(oldest, inputs.u)
        oldest = (oldest + 1) % CELLS
    x = leaving + (state.x - leaving) * exp(-h / parameters.T)
    return State(line, oldest, min(age, period), x)


def outputs(state: State) -> Outputs:
    """Outputs of the sensor, without noise."""
    return Outputs(state.x, state.x)


def seed(parameters: Parameters) -> int:
    """The seed of the noise."""
    return parameters.seed


def measured(parameters: Parameters, y: float, n: float) -> float:
    """The measured temperature with noise."""
    return y + parameters.std * n
