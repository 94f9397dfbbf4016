"""Largest speed in the directions without actuators."""

from __future__ import annotations

from math import sqrt
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import NU


class Inputs(NamedTuple):
    """Sway and heave."""

    drift: Annotated[
        tuple[float, float], Variable({"v": NU["v"], "w": NU["w"]}, "Velocity", name="plant.nu")
    ]


class State(NamedTuple):
    """Largest value of all rows so far."""

    largest: float


class Outputs(NamedTuple):
    """The speed."""

    largest_drift: Annotated[
        float, Variable("m/s", "largest speed of sway and heave, |(v, w)| (Assumption 1)")
    ]


def speed(inputs: Inputs) -> float:
    """Return |(v, w)| [m/s]."""
    v, w = inputs.drift
    return sqrt(v * v + w * w)


def start(inputs: Inputs) -> State:
    """Begin with the first row."""
    return State(speed(inputs))


def update(state: State, inputs: Inputs) -> State:
    """Add a row."""
    drift = speed(inputs)
    return state if drift <= state.largest else State(drift)


def outputs(state: State) -> Outputs:
    """Return the speed."""
    return Outputs(state.largest)
