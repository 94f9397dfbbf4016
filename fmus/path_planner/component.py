"""Path planner: reference through waypoints with velocity and acceleration."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable, __author__, __citation__, __license__, __version__
from auv_fmu.guidance import follower, path_planner
from auv_fmu.guidance.path_planner import Parameters, PathState
from auv_fmu.language.quantities import ETA_WITHOUT_ROLL
from auv_fmu.language.vectors import Vector5
from auv_fmu.paper.motion_planner import Reference


class Outputs(NamedTuple):
    """The reference, and the posture of a vehicle that points along it."""

    reference: Annotated[Reference, Variable(name="")]
    eta_d: Annotated[
        Vector5, Variable(ETA_WITHOUT_ROLL, "Posture of a vehicle that points along the path")
    ]


def check(parameters: Parameters) -> None:
    """Refuse a path that the vehicle cannot follow."""
    path_planner.check(parameters)


def start(parameters: Parameters, t: float) -> PathState:
    """Return the state at the start."""
    return path_planner.initial_state(parameters.waypoints, t)


def update(parameters: Parameters, state: PathState, t: float, h: float) -> PathState:
    """Return the state after a step."""
    return path_planner.advance(parameters.waypoints, state, t + h)


def outputs(parameters: Parameters, state: PathState) -> Outputs:
    """Return the reference and the posture."""
    waypoints = parameters.waypoints
    wanted = path_planner.reference(waypoints, state.ahead, state.t)
    along = path_planner.course(waypoints, state.ahead, wanted.dy_d)
    return Outputs(wanted, follower.posture(wanted.y_d, along, parameters.follower.ell))


def check_state(parameters: Parameters, state: PathState) -> None:
    """Refuse a next corner that contradicts the time."""
    waypoints = parameters.waypoints
    first = path_planner.first_corner(waypoints, state.start)
    ahead = path_planner.corner_ahead(waypoints, first, state.t)
    if state.ahead.k != ahead.k or state.ahead.t != ahead.t:
        raise Refusal("its corner ahead is another than that at its time")
