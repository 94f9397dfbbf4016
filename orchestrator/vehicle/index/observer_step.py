"""Step gain of the observer's fastest mode, which tells whether it is stable."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.paper.observer import EULER, EXACT, Form, exact_gain
from auv_fmu.proof.gain_conditions import observer_rate


class Inputs(NamedTuple):
    """Parameters of the observer."""

    k_d: Annotated[float, Variable("1/s", "Its gain", name="controller.k_d")]
    lambda_: Annotated[float, Variable("m/s", "Entry of Lambda", name="controller.lambda")]
    h_max: Annotated[float, Variable("s", "Largest internal step", name="controller.h_max")]
    form: Annotated[Form, Variable(description="Its form", name="controller.observer")] = EULER


class Outputs(NamedTuple):
    """Largest values of all steps."""

    internal_step: Annotated[float, Variable("s", "internal step of the controller")]
    observer_step: Annotated[float, Variable("1", "h p of the observer's fastest mode")]


def gain_of(inputs: Inputs, h: float) -> float:
    """Return k_d as used in an internal step of h seconds [1/s]: its form may change it."""
    return exact_gain(inputs.k_d, h) if inputs.form == EXACT else inputs.k_d


def of_step(inputs: Inputs, h: float) -> Outputs:
    """Return the numbers of a step of h seconds."""
    internal = min(h, inputs.h_max)
    return Outputs(internal, internal * observer_rate(inputs.lambda_, gain_of(inputs, internal)))


def start() -> Outputs:
    """Begin without a step."""
    return Outputs(0.0, 0.0)


def update(state: Outputs, inputs: Inputs, h: float) -> Outputs:
    """Add a step; the last one may be shorter than the others."""
    return of_step(inputs, h) if h > state.internal_step else state


def outputs(state: Outputs) -> Outputs:
    """Return the largest values."""
    return state
