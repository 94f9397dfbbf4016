"""Ports of the vehicle. Declared while their module is imported, so it is run once more."""

from __future__ import annotations

from runpy import run_path

from auv_fmu.vehicle import Vehicle
from fmus.ports import vehicle

UNITS = {
    **dict.fromkeys(("m11", "m22", "m33"), "kg"),
    **dict.fromkeys(("m55", "m66"), "kg.m2"),
    **dict.fromkeys(("d11", "d22", "d33"), "kg/s"),
    **dict.fromkeys(("d55", "d66"), "kg.m2/s"),
    "righting.pitch": "N.m",
}


def test_parameters_of_equation_2_are_declared_with_their_units_and_bounds():
    declared = run_path(vehicle.__file__, run_name=vehicle.__name__)["VEHICLE"]
    ports = {port.name: port for port in declared.ports}
    assert {name: port.unit for name, port in ports.items()} == UNITS
    assert declared.of({name: port.start for name, port in ports.items()}) == Vehicle()
    for name, port in ports.items():
        if name.startswith("m"):
            assert port.minimum is not None and port.minimum > 0.0, (
                "accelerations are divided by it"
            )
            assert port.description == f"Mass or inertia including added mass: {name[1:]}"
        elif name.startswith("d"):
            assert port.minimum == 0.0, "damping takes energy"
            assert port.description == f"Linear damping: {name[1:]}"
