"""A path from a table of waypoints, as the parameters of a PathPlanner."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from auv_fmu import path_planner
from auv_fmu.actuators import Limits
from auv_fmu.path_planner import MOST, Parameters, Waypoints
from auv_fmu.vehicle import Vehicle
from orchestrator.machine.user_files import explained, lines_of
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.system.values import finite
from orchestrator.vehicle.signals import ACTUATORS

#: The name of its model.
_MODEL = "PathPlanner"

#: The columns of a table, without times and with them, and what may separate them.
_PLACE, _TIMED = ("x", "y", "z"), ("t", "x", "y", "z")
_SEPARATORS = ",;\t"


def path_parameters(path: Path, component: str) -> dict[PortName, Any]:
    """Parameters with which a planner runs through the waypoints of a table.

    Args:
        path: CSV with a line of names, x, y, z and maybe t, and a line a waypoint.
        component: that is the planner.

    Raises:
        InputError: there is no such table, or it has a mistake.

    """
    with explained(path, "not a table of waypoints"), lines_of(path, newline="") as lines:
        first = next(lines, "")
        separator = next((mark for mark in _SEPARATORS if mark in first), _SEPARATORS[0])
        reader = csv.DictReader(chain([first], lines), delimiter=separator, skipinitialspace=True)
        names = [name.strip().lower() for name in reader.fieldnames or ()]
        if sorted(names) not in (sorted(_PLACE), sorted(_TIMED)):
            raise ValueError(f"its columns are {', '.join(names)}; use x, y, z or t, x, y, z")
        reader.fieldnames = names
        waypoints = [_waypoint(row, names, f"line {reader.line_num}") for row in reader]
        if not 2 <= len(waypoints) <= MOST:
            raise ValueError(f"it has {len(waypoints)} waypoints; a path has 2 to {MOST}")
    values: dict[str, Any] = {"count": len(waypoints), "timed": "t" in names}
    for number, waypoint in enumerate(waypoints, start=1):
        values |= {f"waypoint[{number}].{name}": value for name, value in waypoint.items()}
    return {PortName(component, port): value for port, value in values.items()}


def impossible_paths(system: System) -> Iterator[str]:
    """What PathPlanners of a system will refuse of their paths, without a run of them."""
    for name, component in system.components.items():
        if component.description.modelName != _MODEL:
            continue
        try:
            path_planner.check(_planned({**component.starts, **system.parameters_of(name)}))
        except KeyError:
            # Another model of that name.
            continue
        except ArithmeticError as error:
            yield f"{name}: {error}"


def _planned(values: Mapping[str, Any]) -> Parameters:
    """Parameters of the equations, from the values of ports."""
    x, y, z, t = (
        tuple(values[f"waypoint[{k}].{axis}"] for k in range(1, 1 + MOST)) for axis in "xyzt"
    )
    timed, cruise, rounding = (values[name] for name in ("timed", "cruise", "rounding"))
    limits = (tuple(values[f"{end}.{name}"] for name in ACTUATORS) for end in Limits._fields)
    return Parameters(
        Waypoints(values["count"], x, y, z, t, timed, cruise, rounding),
        Vehicle(*(values[name.replace("_", ".")] for name in Vehicle._fields)),
        values["ell"],
        Limits(*limits),
        values["speed_max"],
        values["turn_max"],
    )


def _waypoint(row: Mapping[Any, Any], names: Sequence[str], where: str) -> dict[str, float]:
    if None in row or None in row.values():
        raise ValueError(f"{where} has not {len(names)} values")
    return {name: finite(row[name], f"{where}, {name}:") for name in names}
