"""The system that the equations make: Fig. 2, of the bundle's components."""

from __future__ import annotations

from pathlib import Path

from orchestrator.runs.wiring import closed_loop
from orchestrator.system.component import Component, read_component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System
from orchestrator.vehicle.signals import AXES

#: The controller that is told the velocity, and the wires for it.
_TOLD = "PdController"
_VELOCITY = {
    Connection(PortName("plant", f"dy.{axis}"), PortName("controller", f"dy.{axis}"))
    for axis in AXES
}


def difference(system: System, fmus: Path) -> str:
    """What a system has that this one has not, or the other way round; empty: nothing.

    Args:
        system: to be looked at.
        fmus: folder of the bundle's.

    """
    standard = closed_loop(fmus)
    wanted = {name: {_contents(part)} for name, part in standard.components.items()}
    wanted["controller"].add(_contents(read_component("controller", fmus / f"{_TOLD}.fmu")))
    for name, choices in wanted.items():
        if name not in system.components:
            return f"it has no {name}"
        if _contents(system.components[name]) not in choices:
            return f"its {name} is {system.components[name].fmu}"
    for name in system.components.keys() - wanted:
        return f"it has {name} besides"
    connections, wires = set(system.connections), set(standard.connections)
    if system.components["controller"].fmu.stem == _TOLD:
        wires |= _VELOCITY
    for one in sorted(map(_shown, connections - wires)):
        return f"it has the wire {one}"
    for one in sorted(map(_shown, wires - connections)):
        return f"it has no wire {one}"
    later = [f"it starts at {system.start_time:g} s"] if system.start_time else []
    return next(iter([*(f"its {name} has a step of its own" for name in system.steps), *later]), "")


def _contents(part: Component) -> tuple[str, str]:
    """Name and digest of an FMU: the same one may lie in several folders."""
    return part.fmu.name, part.digest


def _shown(connection: Connection) -> str:
    return f"{connection.source} -> {connection.target}"
