"""Formation planner: reference of a vehicle that keeps its place beside a leader."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __citation__, __license__, __version__
from auv_fmu.guidance import formation
from auv_fmu.guidance.formation import FormationState, Known, Parameters
from auv_fmu.language.quantities import ETA_WITHOUT_ROLL
from auv_fmu.language.vectors import Vector5
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.motion_planner import Reference

H_MAX = STEP


class Outputs(NamedTuple):
    """The reference, and the posture of a vehicle that points along it."""

    reference: Annotated[Reference, Variable(name="")]
    eta_d: Annotated[
        Vector5,
        Variable(ETA_WITHOUT_ROLL, "Posture of a vehicle that points along its reference"),
    ]


def check(parameters: Parameters) -> None:
    """Refuse stages that no vehicle can follow one after another."""
    formation.check(parameters)


def start(inputs: Known) -> FormationState:
    """Return the state at the start."""
    return formation.first_state(inputs)


def update(
    parameters: Parameters, state: FormationState, inputs: Known, h: float
) -> FormationState:
    """Return the state after a step."""
    return formation.step(parameters, state, inputs, h)


def outputs(parameters: Parameters, state: FormationState, inputs: Known, t: float) -> Outputs:
    """Return the reference, from the last known state of the leader."""
    wanted = formation.reference(parameters, state, inputs, t)
    return Outputs(wanted, formation.posture(parameters, state, wanted))
