"""How Allocation runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`.

Like the controllers it is sampled: its outputs belong to the beginning of the step.
"""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu.allocation import Parameters, evaluate
from auv_fmu.vectors import Vector3
from fmus.ports.groups import Nothing


class Inputs(NamedTuple):
    """Wanted force and moments, and the velocity through the water."""

    tau: Vector3
    nu_r: Vector3


class Outputs(TypedDict):
    """Commands of fins and propeller, and what they give."""

    command: Vector3
    tau_attained: Vector3


def begin(parameters: Parameters, inputs: Inputs) -> tuple[Nothing, Outputs]:
    """Outputs at the start."""
    return Nothing(), _seen(parameters, inputs)


def advance(parameters: Parameters, state: Nothing, inputs: Inputs) -> tuple[Nothing, Outputs]:
    """Outputs of a step: computed at its beginning, held through it."""
    return state, _seen(parameters, inputs)


def _seen(parameters: Parameters, inputs: Inputs) -> Outputs:
    command, attained = evaluate(parameters, inputs.tau, inputs.nu_r)
    return {"command": command, "tau_attained": attained}
