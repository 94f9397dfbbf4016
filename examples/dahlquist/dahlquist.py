"""Dahlquist's test equation, by which methods of integration are judged.

    dx/dt = -k x,  with the solution  x(t) = x0 exp(-k t)

G. Dahlquist used it in 1963 to define when a method is stable. The explicit Euler rule, which steps
it here, multiplies `x` by 1 - k h in each step of h seconds. So `x` decays only if k h is below 2,
and without a change of sign only if k h is at most 1.

This is the model Dahlquist of the Reference FMUs of the Modelica Association, with the same names
and values. With `h_max` = 0.1 s it gives their published result bit for bit.

Compare `x` with `exact`, then make the internal steps longer: `h_max` = 1.5 s, and 2.5 s.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Parameters(NamedTuple):
    """The rate, and the start."""

    k: Annotated[float, Variable("1/s", "Rate of the decay")] = 1.0
    x0: Annotated[float, Variable("1", "Value at the start")] = 1.0


class State(NamedTuple):
    """Its value."""

    x: Annotated[float, Variable("1", "Value")]


class Outputs(NamedTuple):
    """What is seen of it."""

    x: Annotated[float, Variable("1", "Value by the explicit Euler rule")]
    exact: Annotated[float, Variable("1", "Value of the solution")]


def begin(parameters: Parameters) -> tuple[State, Outputs]:
    """State and outputs at the start."""
    return State(parameters.x0), Outputs(parameters.x0, parameters.x0)


def advance(
    parameters: Parameters, state: State, t: float, h: float, n: int
) -> tuple[State, Outputs]:
    """State and outputs after n steps of h seconds."""
    x = state.x
    for _ in range(n):
        x += h * (-parameters.k * x)
    return State(x), Outputs(x, parameters.x0 * exp(-parameters.k * (t + n * h)))
