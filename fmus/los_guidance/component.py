"""Line-of-sight guidance along waypoints: proportional, integral or adaptive."""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu import Refusal, __author__, __license__, __version__
from auv_fmu.guidance import los
from auv_fmu.guidance.los import Guided, Leg, Parameters, Position, State
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper.euler import STEP

SAMPLED = True

H_MAX = STEP


class Place(NamedTuple):
    """The leg, and the vehicle in its frame."""

    line: Leg
    e: Vector3  #: [m]


def check(parameters: Parameters) -> None:
    """Refuse waypoints between which there is no guidance."""
    los.check(parameters.path, parameters.radius)


def start(parameters: Parameters, inputs: Position) -> State:
    """Return the state at the start."""
    return los.begin(parameters, inputs.y)


def derive(parameters: Parameters, state: State, inputs: Position) -> Place:
    """Return the leg, and the errors across it."""
    line = los.leg(parameters.path, state.k)
    return Place(line, los.errors(line, inputs.y))


def update(parameters: Parameters, state: State, derived: Place, h: float) -> State:
    """Return the state after a step."""
    return los.advance(parameters, state, derived.line, derived.e, h)


def outputs(parameters: Parameters, state: State, derived: Place) -> Guided:
    """Return the desired motion, and the errors."""
    return los.guided(parameters, state, derived.line, derived.e)


def check_state(parameters: Parameters, state: State) -> None:
    """Refuse a waypoint that is not on the path."""
    if not 1 <= state.k <= parameters.path.n:
        raise Refusal("its waypoint is not on the path")
