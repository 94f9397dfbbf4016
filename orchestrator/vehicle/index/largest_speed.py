"""Largest speed of the control point."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import VELOCITY
from auv_fmu.language.vectors import Vector3, norm


class Inputs(NamedTuple):
    """The velocity of the control point."""

    dy: Annotated[Vector3, Variable(VELOCITY, "Velocity", name="plant.dy")]


class State(NamedTuple):
    """Largest value of all rows so far."""

    largest: float


class Outputs(NamedTuple):
    """The speed."""

    largest_speed: Annotated[float, Variable("m/s", "largest speed of the control point, |dy|")]


def start(inputs: Inputs) -> State:
    """Begin with the first row."""
    return State(norm(inputs.dy))


def update(state: State, inputs: Inputs) -> State:
    """Add a row."""
    speed = norm(inputs.dy)
    return state if speed <= state.largest else State(speed)


def outputs(state: State) -> Outputs:
    """Return the speed."""
    return Outputs(state.largest)
