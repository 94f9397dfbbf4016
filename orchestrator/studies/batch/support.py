"""The systems that the equations make, and the setting of the loop that their parameters make."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from auv_fmu.language.variable import Refusal
from auv_fmu.loop import blocks
from auv_fmu.loop.blocks import SeaWaves
from auv_fmu.loop.closed_loop import LongestSteps, Setting
from auv_fmu.water.sea import Sea
from fmus.discovery import source_of
from fmus.ports.port import H_MAX, Port
from orchestrator.machine.errors import InputError
from orchestrator.master.plan import code_of
from orchestrator.runs.scenario import Scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.component import Component
from orchestrator.system.connection import Connection
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.vehicle.signals import AXES, DIRECTIONS

#: Where a value lies: fields, and places in tuples.
Place = tuple[str | int, ...]

#: Inputs that a loop may leave open: the velocity of the water, if there is no sea, and others that
#: the equations here have no place for.
_WATER = [PortName("plant", f"water.{axis}") for axis in AXES]
_STAY_ZERO = {
    *(PortName("plant", f"dwater.{axis}") for axis in AXES),
    *(PortName("disturbance", f"nu.{direction}") for direction in DIRECTIONS),
}

#: What may stand in the loop instead of its own component of that name, or besides.
_INSTEAD = {
    "plant": "Remus100",
    "controller": "PdController",
    "planner": "PathPlanner",
    "sea": "Sea",
}

#: What that takes: components, and wires that are other ones, or removed.
_COMPONENTS_WITH: Mapping[str, Mapping[str, str]] = {"Remus100": {"allocation": "Allocation"}}
_WIRES_WITH: Mapping[str, Mapping[str, str | bool]] = {
    "PdController": {"controller.dy": "plant.dy"},
    "Sea": {"sea.eta": "plant.eta", "plant.water": "sea.water", "plant.dwater": "sea.dwater"},
    "Remus100": {
        "allocation.tau": "controller.tau",
        "allocation.nu_r": "plant.nu_r",
        "plant.command": "allocation.command",
        "plant.tau": False,
        "plant.tau_w": False,
        "disturbance.nu": False,
    },
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
    wanted = _nearest(system, fmus)
    for name, part in wanted.components.items():
        if name not in system.components:
            return f"it has no {name}"
        if _contents(system.components[name]) != _contents(part):
            return f"its {name} is {system.components[name].fmu}"
    for name in system.components.keys() - wanted.components:
        return f"it also has {name}"
    connections, wires = set(system.connections), set(wanted.connections)
    for one in sorted(map(_shown, connections - wires)):
        return f"it has the wire {one}"
    for one in sorted(map(_shown, wires - connections)):
        return f"it has no wire {one}"
    later = [f"it starts at {system.start_time:g} s"] if system.start_time else []
    return next(iter([*(f"its {name} has a longer step" for name in system.steps), *later]), "")


def _nearest(system: System, fmus: Path) -> System:
    """The loop of those that the equations make that has the same components, where there is one.

    Args:
        system: to be looked at.
        fmus: folder of the bundle's.

    """
    components: dict[str, str] = {}
    wires: dict[str, str | bool] = {}
    for name, fmu in _INSTEAD.items():
        if name in system.components and system.components[name].fmu.stem == fmu:
            components |= {name: fmu, **_COMPONENTS_WITH.get(fmu, {})}
    for fmu in _WIRES_WITH:
        if fmu in components.values():
            wires |= _WIRES_WITH[fmu]
    return closed_loop(fmus, Scenario("", components=components, wires=wires))


def _contents(part: Component) -> tuple[str, str]:
    """Name and digest of an FMU: the same one may lie in several folders."""
    return part.fmu.name, part.digest


def _shown(connection: Connection) -> str:
    return f"{connection.source} -> {connection.target}"


class _Block(NamedTuple):
    """A component as the equations have it."""

    ports: Mapping[str, Port]  #: its parameters, all but `h_max`
    paths: Mapping[str, Place]  #: where each lies in the set of the equations
    starts: Any  #: that set, of the ports' own values
    check: Callable[[Any], object]  #: refuses values that do not fit


@cache
def _block(fmu: str) -> _Block:
    """A component, by the name of its FMU."""
    definition = source_of(fmu).definition
    parameters, check = definition.parameters, definition.behaviour.hooks["check"]
    ports = {port.name: port for port in parameters.ports}
    starts = {name: port.start for name, port in ports.items() if port.start is not None}
    values, paths = parameters.of(starts), parameters.paths
    for name, port in ports.items():
        if port.choices:
            # Numba takes many times as long to look at a member of an enumeration as at a number.
            values = _replaced(values, paths[name], int(starts[name]))
    # Runs of a study mostly have the same path, and to check it takes a while.
    checked = lru_cache(maxsize=8)(check) if check else lambda values: None
    return _Block(ports, paths, values, checked)


def setting_of(fmus: Mapping[str, str], parameters: Mapping[PortName, Any], step: float) -> Setting:
    """The setting of the loop.

    Args:
        fmus: the name of the FMU of each component; these are the blocks of the setting.
        parameters: that differ from the FMUs' own, in the types of their ports.
        step: of the run [s].

    Raises:
        InputError: a component would refuse a value, or the equations here have no place for it.

    """
    components = {name: _block(fmu) for name, fmu in fmus.items()}
    sets = {name: component.starts for name, component in components.items()}
    longest: dict[str, Any] = {}
    for name, value in parameters.items():
        component, port = name.component, name.port
        declared = components[component].ports.get(port)
        if port == H_MAX:
            longest[component] = value
        elif declared:
            try:
                good = declared.checked(value)
            except Refusal as refusal:
                raise InputError(f"{component}: {refusal}") from None
            sets[component] = _replaced(sets[component], components[component].paths[port], good)
        elif name in _STAY_ZERO and value:
            raise InputError(f"{name}: the batch engine has no place for it; leave it 0")
    for role, block in components.items():
        try:
            block.check(sets[role])
        except (Refusal, ArithmeticError, ValueError) as refusal:
            raise InputError(f"initialisation refused: {refusal}") from None
    water: Any = tuple(parameters.get(name, 0.0) for name in _WATER)
    if "sea" in sets:
        of_sea = sets.pop("sea")
        water = _sea_waves(of_sea, repr(of_sea))
    return Setting(**sets, water=water, h_max=LongestSteps(**longest), h=step)


@lru_cache(maxsize=8)
def _sea_waves(parameters: Sea, text: str) -> SeaWaves:
    """A sea by its parameters, and by their text, which tells 0.0 from -0.0: it takes a while."""
    return blocks.sea_waves(parameters)


def _replaced(whole: Any, path: Place, value: object) -> Any:
    """A set with another value at a place."""
    if not path:
        return value
    first, *rest = path
    if isinstance(first, int):
        changed = _replaced(whole[first], tuple(rest), value)
        return (*whole[:first], changed, *whole[first + 1 :])
    return whole._replace(**{first: _replaced(getattr(whole, first), tuple(rest), value)})
