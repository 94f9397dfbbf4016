"""How the equations run in PathPlanner, in either kind of it."""

from __future__ import annotations

from typing import TypedDict

from auv_fmu import path_planner
from auv_fmu.path_planner import Parameters, PathState
from auv_fmu.types import Vector3, Vector5


class Outputs(TypedDict):
    """The reference, and the posture of a vehicle that points along it."""

    y_d: Vector3
    dy_d: Vector3
    ddy_d: Vector3
    eta_d: Vector5


def check(parameters: Parameters) -> None:
    """Refuse a path that the vehicle cannot follow."""
    path_planner.check(parameters)


def begin(parameters: Parameters, t: float) -> tuple[PathState, Outputs]:
    """State and outputs at the start."""
    state = PathState(t, t)
    return state, expected(parameters, state)


def advance(
    parameters: Parameters, state: PathState, t: float, h: float
) -> tuple[PathState, Outputs]:
    """State and outputs after a step of h seconds."""
    state = PathState(state.start, t + h)
    return state, expected(parameters, state)


def expected(parameters: Parameters, state: PathState) -> Outputs:
    """The outputs that belong to a state."""
    waypoints = parameters.waypoints
    first = path_planner.first_corner(waypoints, state.start)
    corner = path_planner.corner_ahead(waypoints, first, state.t)
    y_d, dy_d, ddy_d = path_planner.reference(waypoints, corner, state.t)
    along = path_planner.course(waypoints, corner, dy_d)
    eta_d = path_planner.posture(y_d, along, parameters.ell)
    return {"y_d": y_d, "dy_d": dy_d, "ddy_d": ddy_d, "eta_d": eta_d}
