"""How FirstOrderLag runs in both kinds of FMU: T dx/dt = u - x, solved exactly."""

from __future__ import annotations

from math import expm1
from typing import NamedTuple, TypedDict

from auv_fmu.actuators import limit


class Lag(NamedTuple):
    """Its parameters."""

    T: float = 0.5  #: time constant [s]
    x0: float = 1.0  #: value at the start [m]
    std: float = 0.01  #: standard deviation of the noise [m]
    seed: int = 1  #: of the noise


class Inputs(NamedTuple):
    """What it follows."""

    u: tuple[float]


class State(NamedTuple):
    """Its value."""

    x: float


class Outputs(TypedDict):
    """Its value, and what is measured of it."""

    x: tuple[float]
    y: tuple[float]


def begin(parameters: Lag) -> tuple[State, Outputs]:
    """State and outputs at the start."""
    state = State(parameters.x0)
    return state, _seen(state)


def advance(
    parameters: Lag, state: State, inputs: Inputs, h: float, n: int
) -> tuple[State, Outputs]:
    """State and outputs after n steps of h seconds, exact for a held input."""
    x = state.x
    after = State(x - (inputs.u[0] - x) * expm1(-h * n / parameters.T))
    return after, _seen(after)


def seed(parameters: Lag) -> int:
    """Of the noise."""
    return parameters.seed


def measured(parameters: Lag, y: tuple[float], n: tuple[float]) -> tuple[float]:
    """The value with noise."""
    return (y[0] + parameters.std * n[0],)


def expected(parameters: Lag, state: State, outputs: Outputs) -> Outputs:
    """The outputs that belong to a state; no noise of a generator is further off than this."""
    most = 9.0 * parameters.std
    noisy = outputs["y"][0]
    return {"x": (state.x,), "y": (state.x + limit(noisy - state.x, -most, most),)}


def _seen(state: State) -> Outputs:
    return {"x": (state.x,), "y": (state.x,)}
