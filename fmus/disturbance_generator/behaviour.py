"""How DisturbanceGenerator runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu.disturbance import Disturbance, disturbance
from auv_fmu.vectors import Vector6
from fmus.ports.groups import Nothing


class Inputs(NamedTuple):
    """Velocity of the vehicle."""

    nu: Vector6


class Outputs(TypedDict):
    """The disturbance."""

    tau_w: Vector6


def begin(parameters: Disturbance, inputs: Inputs, t: float) -> tuple[Nothing, Outputs]:
    """Outputs at the start."""
    return Nothing(), {"tau_w": disturbance(parameters, inputs.nu, t)}


def advance(
    parameters: Disturbance, state: Nothing, inputs: Inputs, t: float
) -> tuple[Nothing, Outputs]:
    """Outputs of a step: computed at its beginning, held through it."""
    return state, {"tau_w": disturbance(parameters, inputs.nu, t)}
