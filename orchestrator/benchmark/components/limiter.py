"""The limits of a vehicle's actuators: a force and two moments, each within its own range."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector

UNITS = {"u": "N", "q": "N.m", "r": "N.m"}

SAMPLED, STEP_SIZE = True, 0.02


class Parameters(NamedTuple):
    """Limits."""

    tau_max: Annotated[Vector, 3, Variable(UNITS, "Largest magnitude", POSITIVE)] = Vector(
        (80.0, 80.0, 80.0)
    )


class Inputs(NamedTuple):
    """The command of a law."""

    command: Annotated[Vector, 3, Variable(UNITS, "Wanted force and moments")]


class Outputs(NamedTuple):
    """The command that reaches the vehicle."""

    tau: Annotated[Vector, 3, Variable(UNITS, "Force and moments within the limits")]


def outputs(parameters: Parameters, inputs: Inputs) -> Outputs:
    """Limit each to its range."""
    most, wanted = parameters.tau_max, inputs.command
    return Outputs(Vector(max(-most[i], min(most[i], wanted[i])) for i in range(3)))
