"""How much force the robust term may use at any speed: what its chattering follows from."""

from __future__ import annotations

from math import inf, nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Inputs(NamedTuple):
    """The part of the bound that is there at any speed."""

    rho_hat: Annotated[float, Variable("N", "Its estimate", name="controller.theta_hat[1]")]


class State(NamedTuple):
    """Of all steps so far."""

    largest: float


class Outputs(NamedTuple):
    """The bound."""

    largest_bound: Annotated[float, Variable("N", "largest theta_hat[1]")]


def start() -> State:
    """No step yet."""
    return State(-inf)


def update(state: State, acting: Inputs) -> State:
    """One more step."""
    return state if acting.rho_hat <= state.largest else State(acting.rho_hat)


def outputs(state: State) -> Outputs:
    """The bound, if there was a step."""
    return Outputs(state.largest if state.largest > -inf else nan)
