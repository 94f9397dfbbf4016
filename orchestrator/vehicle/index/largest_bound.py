"""Largest force that the robust term may use at any speed, which determines its chattering."""

from __future__ import annotations

from math import inf, nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Inputs(NamedTuple):
    """The part of the bound that does not depend on the speed."""

    rho_hat: Annotated[float, Variable("N", "Its estimate", name="controller.theta_hat[1]")]


class State(NamedTuple):
    """Largest value of all steps so far."""

    largest: float


class Outputs(NamedTuple):
    """The bound."""

    largest_bound: Annotated[float, Variable("N", "largest theta_hat[1]")]


def start() -> State:
    """Begin without a step."""
    return State(-inf)


def update(state: State, acting: Inputs) -> State:
    """Add a step."""
    return state if acting.rho_hat <= state.largest else State(acting.rho_hat)


def outputs(state: State) -> Outputs:
    """Return the bound, if there was a step."""
    return Outputs(state.largest if state.largest > -inf else nan)
