"""How FormationPlanner runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from typing import TypedDict

from auv_fmu import formation
from auv_fmu.formation import FormationState, Known, Parameters
from auv_fmu.vectors import Vector3, Vector5


class Outputs(TypedDict):
    """The reference, and the posture of a vehicle that points along it."""

    y_d: Vector3
    dy_d: Vector3
    ddy_d: Vector3
    eta_d: Vector5


def check(parameters: Parameters) -> None:
    """Refuse stages that no vehicle can change between."""
    formation.check(parameters)


def begin(parameters: Parameters, inputs: Known, t: float) -> tuple[FormationState, Outputs]:
    """State and outputs at the start."""
    state = formation.first_state(inputs)
    return state, _seen(parameters, state, inputs, t)


def advance(
    parameters: Parameters, state: FormationState, inputs: Known, t: float, h: float, n: int
) -> tuple[FormationState, Outputs]:
    """State and outputs after n steps of h seconds; the leader is where it was before them."""
    state = formation.steps(parameters, state, inputs, h, n)
    return state, _seen(parameters, state, inputs, t + n * h)


def _seen(parameters: Parameters, state: FormationState, inputs: Known, t: float) -> Outputs:
    wanted = formation.reference(parameters, state, inputs, t)
    eta_d = formation.posture(parameters, state, wanted)
    return {"y_d": wanted.y_d, "dy_d": wanted.dy_d, "ddy_d": wanted.ddy_d, "eta_d": eta_d}
