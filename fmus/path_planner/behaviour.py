"""How PathPlanner runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from typing import TypedDict

from auv_fmu import path_planner
from auv_fmu.path_planner import Corner, Parameters, PathState
from auv_fmu.vectors import Vector3, Vector5


class Outputs(TypedDict):
    """The reference, and the posture of a vehicle that points along it."""

    y_d: Vector3
    dy_d: Vector3
    ddy_d: Vector3
    eta_d: Vector5


def check(parameters: Parameters) -> None:
    """Refuse a path that the vehicle cannot follow."""
    path_planner.check(parameters)


def begin(parameters: Parameters, t: float) -> tuple[PathState, Corner, Outputs]:
    """State, the corner ahead and outputs at the start."""
    state = PathState(t, t)
    ahead = derive(parameters, state)
    return state, ahead, _seen(parameters, state, ahead)


def derive(parameters: Parameters, state: PathState) -> Corner:
    """The corner ahead, from which a step looks for its own."""
    waypoints = parameters.waypoints
    first = path_planner.first_corner(waypoints, state.start)
    return path_planner.corner_ahead(waypoints, first, state.t)


def advance(
    parameters: Parameters, state: PathState, derived: Corner, t: float, h: float
) -> tuple[PathState, Corner, Outputs]:
    """State, the corner ahead and outputs after a step of h seconds."""
    later = PathState(state.start, t + h)
    if later.t < state.t:  # a host that goes back
        derived = path_planner.first_corner(parameters.waypoints, state.start)
    ahead = path_planner.corner_ahead(parameters.waypoints, derived, later.t)
    return later, ahead, _seen(parameters, later, ahead)


def expected(parameters: Parameters, state: PathState) -> Outputs:
    """The outputs that belong to a state."""
    return _seen(parameters, state, derive(parameters, state))


def _seen(parameters: Parameters, state: PathState, ahead: Corner) -> Outputs:
    waypoints = parameters.waypoints
    y_d, dy_d, ddy_d = path_planner.reference(waypoints, ahead, state.t)
    along = path_planner.course(waypoints, ahead, dy_d)
    eta_d = path_planner.posture(y_d, along, parameters.ell)
    return {"y_d": y_d, "dy_d": dy_d, "ddy_d": ddy_d, "eta_d": eta_d}
