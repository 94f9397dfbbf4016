"""How MotionPlanner runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from typing import TypedDict

from auv_fmu import motion_planner
from auv_fmu.motion_planner import Motion, Parameters, PlannerState
from auv_fmu.vectors import Vector3, Vector5


class Outputs(TypedDict):
    """The reference, and the posture of the vehicle that makes it."""

    y_d: Vector3
    dy_d: Vector3
    ddy_d: Vector3
    eta_d: Vector5


def begin(parameters: Parameters) -> tuple[PlannerState, Motion, Outputs]:
    """State, its motion and outputs at the start."""
    state, moving = motion_planner.begin(parameters)
    return state, moving, _seen(parameters, state, moving)


def derive(parameters: Parameters, state: PlannerState) -> Motion:
    """What a step needs of the state, and the reference at its beginning has needed already."""
    return motion_planner.motion(parameters.vehicle, state, parameters.tau_d)


def advance(
    parameters: Parameters, state: PlannerState, derived: Motion, h: float, n: int
) -> tuple[PlannerState, Motion, Outputs]:
    """State, its motion and outputs after n steps of h seconds."""
    state, derived = motion_planner.steps(parameters, state, derived, h, n)
    return state, derived, _seen(parameters, state, derived)


def expected(parameters: Parameters, state: PlannerState) -> Outputs:
    """The outputs that belong to a state."""
    return _seen(parameters, state, derive(parameters, state))


def _seen(parameters: Parameters, state: PlannerState, moving: Motion) -> Outputs:
    y_d, dy_d, ddy_d = motion_planner.reference(state, moving, parameters.ell)
    eta_d = (*state.position, state.theta, state.psi)
    return {"y_d": y_d, "dy_d": dy_d, "ddy_d": ddy_d, "eta_d": eta_d}
