"""Step gain of the robust term, which tells whether it chatters."""

from __future__ import annotations

from math import nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.proof.gain_conditions import least_inertia, robust_rate


class Inputs(NamedTuple):
    """The part of the bound that does not depend on the speed, and parameters."""

    rho_hat: Annotated[float, Variable("N", "Its estimate", name="controller.theta_hat[1]")]
    eps_t: Annotated[float, Variable("W", "Boundary layer", name="controller.eps_t")]
    h_max: Annotated[float, Variable("s", "Largest internal step", name="controller.h_max")]
    m11: Annotated[float, Variable("kg", "Surge mass", name="plant.m11")]
    m55: Annotated[float, Variable("kg.m2", "Pitch inertia", name="plant.m55")]
    m66: Annotated[float, Variable("kg.m2", "Yaw inertia", name="plant.m66")]
    ell: Annotated[float, Variable("m", "Distance of the control point", name="plant.ell")]


class State(NamedTuple):
    """Largest values of all steps so far."""

    largest: float
    gain: float


class Outputs(NamedTuple):
    """The bound, and the gain."""

    largest_bound: Annotated[float, Variable("N", "largest theta_hat[1]")]
    robust_step: Annotated[float, Variable("1", "largest h p of the robust term")]


def start() -> State:
    """Begin without a step; without a robust term there are no numbers."""
    return State(0.0, 0.0)


def update(state: State, acting: Inputs, h: float) -> State:
    """Add a step."""
    if acting.rho_hat <= state.largest or acting.eps_t <= 0.0 or acting.ell <= 0.0:
        return state
    inertia = least_inertia(acting.m11, acting.m55, acting.m66, acting.ell)
    gain = min(h, acting.h_max) * robust_rate(acting.rho_hat, acting.eps_t, inertia)
    return State(acting.rho_hat, max(state.gain, gain))


def outputs(state: State) -> Outputs:
    """Return the numbers, if there are any."""
    return Outputs(state.largest, state.gain) if state.largest > 0.0 else Outputs(nan, nan)
