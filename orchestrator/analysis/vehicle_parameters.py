"""The vehicle of (2) from the parameters of the plant."""

from __future__ import annotations

from collections.abc import Callable

from auv_fmu.vehicle import Vehicle

#: Parameters of AuvPlant in the order of the fields of Vehicle.
VEHICLE_PARAMETERS = (
    *(f"m{k}{k}" for k in (1, 2, 3, 5, 6)),
    *(f"d{k}{k}" for k in (1, 2, 3, 5, 6)),
    "righting.pitch",
)


def vehicle(value: Callable[[str], float]) -> Vehicle:
    """The vehicle whose parameters a function gives by their names."""
    return Vehicle._make(value(name) for name in VEHICLE_PARAMETERS)
