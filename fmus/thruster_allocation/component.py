"""Allocation of a force and a moment to the eight thrusters of BlueRov2Heavy."""

from __future__ import annotations

from auv_fmu import __author__, __license__, __version__
from auv_fmu.bluerov2 import thruster_allocation, thrusters
from auv_fmu.bluerov2.thruster_allocation import Allocated, Derived, Parameters, Wanted
from auv_fmu.bluerov2.thrusters import __citation__

SAMPLED = True


def check(parameters: Parameters) -> None:
    """Refuse thrusters that do not reach all directions."""
    thrusters.check(parameters.layout)
    thruster_allocation.check(parameters.layout)


def derive(parameters: Parameters) -> Derived:
    """Return the pseudo-inverse of the geometry, and the largest thrusts."""
    return thruster_allocation.derive(parameters)


def outputs(parameters: Parameters, derived: Derived, inputs: Wanted) -> Allocated:
    """Return the commands, and the resulting force and moment."""
    return thruster_allocation.evaluate(parameters, derived, inputs)
