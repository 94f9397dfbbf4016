"""Parameters of (2), shared by the components that integrate it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auv_fmu.control_point import ELL
from auv_fmu.vehicle import Vehicle
from fmus.ports.port import POSITIVE, Port, parameter, parameters

_VEHICLE = Vehicle()

#: In the order of the fields of Vehicle.
VEHICLE: tuple[Port, ...] = (
    *parameters(
        "m",
        _VEHICLE[:5],
        {"11": "kg", "22": "kg", "33": "kg", "55": "kg.m2", "66": "kg.m2"},
        "Mass or inertia with added mass",
        minimum=POSITIVE,
    ),
    *parameters(
        "d",
        _VEHICLE[5:10],
        {"11": "kg/s", "22": "kg/s", "33": "kg/s", "55": "kg.m2/s", "66": "kg.m2/s"},
        "Linear damping",
        minimum=0.0,
    ),
    parameter("righting.pitch", _VEHICLE.righting_pitch, "N.m", "Righting moment in pitch"),
)

CONTROL_POINT = parameter("ell", ELL, "m", "Distance of the control point", POSITIVE)


def vehicle(values: Mapping[str, Any]) -> Vehicle:
    """The vehicle with the values of these parameters."""
    return Vehicle._make(values[port.name] for port in VEHICLE)
