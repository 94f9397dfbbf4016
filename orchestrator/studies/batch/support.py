"""The systems that the equations make, and the setting of the loop that their parameters make."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from auv_fmu import plant
from auv_fmu.closed_loop import LongestSteps, Setting
from fmus.auv_plant import ports as auv_plant
from fmus.disturbance_generator import ports as disturbance_generator
from fmus.motion_planner import ports as motion_planner
from fmus.observer_controller import ports as observer_controller
from fmus.pd_controller import ports as pd_controller
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, Port, Refusal
from orchestrator.machine.errors import InputError
from orchestrator.master.plan import code_of
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.component import Component, read_component
from orchestrator.system.connection import Connection
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.system.values import Value
from orchestrator.vehicle.signals import AXES

#: Where a value lies: fields, and places in tuples.
Place = tuple[str | int, ...]

#: Inputs of the plant that the loop leaves open.
_WATER = [PortName("plant", f"water.{axis}") for axis in AXES]
_SPEEDING_UP = [PortName("plant", f"dwater.{axis}") for axis in AXES]

#: The controller that is told the velocity, and the wires for it.
_TOLD = "PdController"
_VELOCITY = {
    Connection(PortName("plant", f"dy.{axis}"), PortName("controller", f"dy.{axis}"))
    for axis in AXES
}


def digest() -> str:
    """Of the text of all that is compiled, and of the constants that it takes."""
    return code_of("auv_fmu", "orchestrator.vehicle", __package__)[:16]


def unsupported(system: System, fmus: Path) -> str:
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
        return f"it also has {name}"
    connections, wires = set(system.connections), set(standard.connections)
    if system.components["controller"].fmu.stem == _TOLD:
        wires |= _VELOCITY
    for one in sorted(map(_shown, connections - wires)):
        return f"it has the wire {one}"
    for one in sorted(map(_shown, wires - connections)):
        return f"it has no wire {one}"
    later = [f"it starts at {system.start_time:g} s"] if system.start_time else []
    return next(iter([*(f"its {name} has a longer step" for name in system.steps), *later]), "")


def _contents(part: Component) -> tuple[str, str]:
    """Name and digest of an FMU: the same one may lie in several folders."""
    return part.fmu.name, part.digest


def _shown(connection: Connection) -> str:
    return f"{connection.source} -> {connection.target}"


class _Parameters(NamedTuple):
    """The parameters of a component."""

    ports: Mapping[str, Port]
    paths: Mapping[str, Place]  #: where each lies in the set of the equations
    starts: Any  #: that set, of the ports' own values


def _declared(parameters: ParameterSet[Any]) -> _Parameters:
    ports = {port.name: port for port in parameters.ports}
    starts = {name: port.start for name, port in ports.items() if port.start is not None}
    return _Parameters(ports, parameters.paths, parameters.of(starts))


#: By the name of the FMU.
_COMPONENTS: Mapping[str, _Parameters] = {
    "AuvPlant": _declared(auv_plant.PARAMETERS),
    "ObserverController": _declared(observer_controller.PARAMETERS),
    "PdController": _declared(pd_controller.PARAMETERS),
    "DisturbanceGenerator": _declared(disturbance_generator.PARAMETERS),
    "MotionPlanner": _declared(motion_planner.PARAMETERS),
}


def setting_of(
    fmus: Mapping[str, str], parameters: Mapping[PortName, Value], step: float
) -> Setting:
    """The setting of the loop.

    Args:
        fmus: the name of the FMU of each component; these are the blocks of the setting.
        parameters: that differ from the FMUs' own, in the types of their ports.
        step: of the run [s].

    Raises:
        InputError: a component would refuse a value, or the equations here have no place for it.

    """
    for name in _SPEEDING_UP:
        if parameters.get(name):
            raise InputError(f"{name}: the water of the batch engine does not speed up; leave it 0")
    components = {name: _COMPONENTS[fmu] for name, fmu in fmus.items()}
    sets = {name: component.starts for name, component in components.items()}
    longest: dict[str, Any] = {}
    for name, value in parameters.items():
        component, port = name.component, name.port
        declared = components[component].ports.get(port)
        if port == H_MAX.name:
            longest[component] = value
        elif declared:
            try:
                meant = declared.meaning(declared.checked(value))
            except Refusal as refusal:
                raise InputError(f"{component}: {refusal}") from None
            sets[component] = _replaced(sets[component], components[component].paths[port], meant)
    water: Any = tuple(parameters.get(name, 0.0) for name in _WATER)
    sets["plant"] = sets["plant"]._replace(current=plant.flow(sets["plant"], water))
    return Setting(**sets, h_max=LongestSteps(**longest), h=step)


def _replaced(whole: Any, path: Place, value: object) -> Any:
    """A set with another value at a place."""
    if not path:
        return value
    first, *rest = path
    if isinstance(first, int):
        changed = _replaced(whole[first], tuple(rest), value)
        return (*whole[:first], changed, *whole[first + 1 :])
    return whole._replace(**{first: _replaced(getattr(whole, first), tuple(rest), value)})
