"""First-order lag, measured with noise."""

from __future__ import annotations

from math import expm1
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, __author__, __license__, __version__


class Parameters(NamedTuple):
    """Parameters; a tunable one also changes during a run."""

    T: Annotated[float, Variable("s", "Time constant", minimum=POSITIVE, tunable=True)] = 0.5
    x0: Annotated[float, Variable("m", "Value at the start")] = 1.0
    std: Annotated[float, Variable("m", "Standard deviation of the noise", 0.0, 1e6)] = 0.01
    seed: Annotated[int, Variable(description="Seed of the noise")] = 1


class Inputs(NamedTuple):
    """Inputs."""

    u: Annotated[float, Variable("m", "Set point")] = 0.0


class State(NamedTuple):
    """State between steps."""

    x: float  #: [m]


class Outputs(NamedTuple):
    """Outputs."""

    x: Annotated[float, Variable("m", "Value")]
    y: Annotated[float, Variable("m", "Value, measured")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.x0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds, in which the input is held."""
    return State(state.x - (inputs.u - state.x) * expm1(-h / parameters.T))


def outputs(state: State) -> Outputs:
    """Outputs of a state, without noise."""
    return Outputs(x=state.x, y=state.x)


def seed(parameters: Parameters) -> int:
    """The seed of the noise."""
    return parameters.seed


def measured(parameters: Parameters, y: float, n: float) -> float:
    """The measured value, from a standard normal number n."""
    return y + parameters.std * n
