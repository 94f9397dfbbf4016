"""A component of one equation, dx/dt = gain a, with the output b, and the time."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable

H_MAX = 0.02


class Parameters(NamedTuple):
    gain: Annotated[float, Variable("1", "Gain", minimum=0.0, tunable=True)] = 1.0
    up: Annotated[bool, Variable("1", "Which way")] = True
    most: Annotated[float, Variable("1", "Largest gain", minimum=0.0, tunable=True)] = 9.0


class Inputs(NamedTuple):
    a: Annotated[tuple[float, float], Variable("m", "Rate", members=("x", "y"))]


class State(NamedTuple):
    x: tuple[float, float]


class Outputs(NamedTuple):
    b: Annotated[tuple[float, float], Variable("m", "Place", members=("x", "y"))]
    c: Annotated[float, Variable("s", "Time")]


def check(parameters: Parameters) -> None:
    if parameters.gain > parameters.most:
        raise Refusal("too much")


def start(inputs: Inputs) -> State:
    return State(inputs.a)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    rate = parameters.gain if parameters.up else -parameters.gain
    return State((state.x[0] + h * rate * inputs.a[0], state.x[1] + h * rate * inputs.a[1]))


def outputs(state: State, t: float) -> Outputs:
    return Outputs(state.x, t)


def check_state(state: State) -> None:
    if state.x[0] == 123.0:
        raise Refusal("it is not reached")
