"""Dahlquist's test equation, by which methods of integration are judged.

    dx/dt = -k x,  with the solution  x(t) = x0 exp(-k t)

G. Dahlquist used it in 1963 to define when a method is stable. The explicit Euler rule, which steps
it here, multiplies `x` by 1 - k h in each step of h seconds. So `x` decays only if k h is below 2,
and without a change of sign only if k h is at most 1.

This is the model Dahlquist of the Reference FMUs of the Modelica Association, with the same names,
values and steps. It gives their published result bit for bit.

Compare `x` with `exact`, which depends on the time only. Then make the steps longer, with `h_max`
as long: 1.5 s, and 2.5 s.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, NamedTuple

from auv_fmu import Variable

H_MAX, STEP_SIZE, STOP_TIME = 0.1, 0.1, 10.0


class Parameters(NamedTuple):
    """Rate and start."""

    k: Annotated[float, Variable("1/s", "Rate of the decay")] = 1.0
    x0: Annotated[float, Variable("1", "Value at the start")] = 1.0


class State(NamedTuple):
    """Value of x."""

    x: Annotated[float, Variable("1", "Value")]


class Outputs(NamedTuple):
    """Outputs of the equation."""

    x: Annotated[float, Variable("1", "Value by the explicit Euler rule", feedthrough=())]
    exact: Annotated[float, Variable("1", "Value of the solution")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.x0)


def update(parameters: Parameters, state: State, h: float) -> State:
    """State after a step of h seconds."""
    return State(state.x + h * rates(parameters, state).x)


def rates(parameters: Parameters, state: State) -> State:
    """Rate of the state."""
    return State(-parameters.k * state.x)


def outputs(parameters: Parameters, state: State, t: float) -> Outputs:
    """Outputs of the equation."""
    return Outputs(state.x, parameters.x0 * exp(-parameters.k * t))
