"""Motion planner: helical reference with velocity and acceleration."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __citation__, __license__, __version__
from auv_fmu.language.quantities import ETA_WITHOUT_ROLL
from auv_fmu.language.vectors import Vector5
from auv_fmu.paper import motion_planner
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.motion_planner import Motion, Parameters, PlannerState, Reference

H_MAX = STEP


class Outputs(NamedTuple):
    """The reference, and the posture of the reference vehicle."""

    reference: Annotated[Reference, Variable(name="")]
    eta_d: Annotated[Vector5, Variable(ETA_WITHOUT_ROLL, "Posture of the reference vehicle")]


def start(parameters: Parameters) -> PlannerState:
    """Return the state at the start."""
    return motion_planner.initial_state(parameters.eta0, parameters.nu0)


def derive(parameters: Parameters, state: PlannerState) -> Motion:
    """Return attitude and accelerations of the reference vehicle."""
    return motion_planner.motion(parameters.vehicle, state, parameters.tau_d)


def update(state: PlannerState, derived: Motion, h: float) -> PlannerState:
    """Return the state after a step."""
    return motion_planner.step(state, derived, h)


def outputs(parameters: Parameters, state: PlannerState, derived: Motion) -> Outputs:
    """Return the reference."""
    wanted = motion_planner.reference(state, derived, parameters.ell)
    return Outputs(wanted, (*state.position, state.theta, state.psi))


def check_state(parameters: Parameters, state: PlannerState) -> None:
    """Refuse a reference that is too steep."""
    motion_planner.motion(parameters.vehicle, state, parameters.tau_d)
