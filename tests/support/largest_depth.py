"""An index that the bundle lacks: how deep the centre of mass is."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Inputs(NamedTuple):
    """The depth."""

    z: Annotated[float, Variable("m", "Depth", name="plant.eta.z")]


class State(NamedTuple):
    """Largest depth so far."""

    largest: float


class Outputs(NamedTuple):
    """The depth."""

    largest_depth: Annotated[float, Variable("m", "largest z of the centre of mass")]


def start(inputs: Inputs) -> State:
    """The row of the start."""
    return State(inputs.z)


def update(state: State, inputs: Inputs) -> State:
    """One more row."""
    return State(max(state.largest, inputs.z))


def outputs(state: State) -> Outputs:
    """The depth."""
    return Outputs(state.largest)
