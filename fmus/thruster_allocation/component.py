"""Allocation of a force and a moment to the eight thrusters of BlueRov2Heavy."""

from __future__ import annotations

from typing import Annotated

from auv_fmu import Matrix, __author__, __license__, __version__
from auv_fmu.bluerov2 import thruster_allocation, thrusters
from auv_fmu.bluerov2.thruster_allocation import (
    Allocated,
    Parameters,
    Wanted,
    effect,
    evaluate,
    pseudo_inverse,
)
from auv_fmu.bluerov2.thrusters import COUNT, __citation__

SAMPLED = True


def check(parameters: Parameters) -> None:
    """Refuse thrusters that do not reach all directions."""
    thrusters.check(parameters.layout)
    thruster_allocation.check(parameters.layout)


def derive(parameters: Parameters) -> Annotated[Matrix, COUNT, 6]:
    """Return the pseudo-inverse of the geometry of the thrusters."""
    return pseudo_inverse(effect(parameters.layout))


def outputs(
    parameters: Parameters, derived: Annotated[Matrix, COUNT, 6], inputs: Wanted
) -> Allocated:
    """Return the commands, and the resulting force and moment."""
    return evaluate(parameters, derived, inputs)
