"""SI units of the ports, as modelDescription.xml declares them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Unit(NamedTuple):
    """A unit, the name of the type that variables of this unit have, and its base units."""

    type_name: str
    exponents: Mapping[str, int]


UNITS: dict[str, Unit] = {
    "1": Unit("Dimensionless", {}),
    "1/s": Unit("Rate", {"s": -1}),
    "s": Unit("Time", {"s": 1}),
    "m": Unit("Length", {"m": 1}),
    "m/s": Unit("Velocity", {"m": 1, "s": -1}),
    "m/s2": Unit("Acceleration", {"m": 1, "s": -2}),
    "rad": Unit("Angle", {"rad": 1}),
    "rad/s": Unit("AngularVelocity", {"rad": 1, "s": -1}),
    "N": Unit("Force", {"kg": 1, "m": 1, "s": -2}),
    "N.m": Unit("Torque", {"kg": 1, "m": 2, "s": -2}),
    "W": Unit("Power", {"kg": 1, "m": 2, "s": -3}),
    "kg": Unit("Mass", {"kg": 1}),
    "kg/s": Unit("LinearDamping", {"kg": 1, "s": -1}),
    "N/m": Unit("Stiffness", {"kg": 1, "s": -2}),
    "kg/m": Unit("QuadraticDamping", {"kg": 1, "m": -1}),
    "kg.m2": Unit("MomentOfInertia", {"kg": 1, "m": 2}),
    "kg.m2/s": Unit("AngularDamping", {"kg": 1, "m": 2, "s": -1}),
}
