"""The wiring of the closed loop: its FMUs, and the connections of their ports."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from fmus.discovery import name_of
from orchestrator.cosim import (
    Component,
    Connection,
    PortName,
    System,
    read_component,
)
from orchestrator.machine.errors import Findings, InputError, did_you_mean
from orchestrator.machine.user_files import is_folder
from orchestrator.runs.scenario import EACH_VEHICLE, Scenario, for_each_vehicle

_WIRING = Path(__file__).with_name("closed_loop.toml")


def read_wiring(vehicles: int | None = None) -> dict[str, Any]:
    """Read `closed_loop.toml` for each of several vehicles; None: for a single one."""
    wiring = tomllib.loads(_WIRING.read_text(encoding="utf-8"))
    if vehicles is None:
        return wiring
    each = f"{EACH_VEHICLE}."
    components = {each + name: fmu for name, fmu in wiring["components"].items()}
    wires = {each + target: source and each + source for target, source in wiring["wires"].items()}
    return {
        **wiring,
        "components": for_each_vehicle(vehicles, components),
        "wires": for_each_vehicle(vehicles, wires),
    }


def component_of(name: str, components: Collection[str]) -> str:
    """Return the component of a port or group; if it is unknown, the text before the first dot."""
    known = (component for component, _ in PortName.splits(name) if component in components)
    return next(known, name.partition(".")[0])


def closed_loop(folder: Path, scenario: Scenario | None = None) -> System:
    """Wire the closed loop of the FMUs in a folder.

    Args:
        folder: with the built FMUs.
        scenario: its components, wires and parameters change the loop; None: no changes.

    Raises:
        Refused: a component or group of ports of the scenario does not exist.

    """
    findings, wiring = Findings(), read_wiring(scenario.vehicles if scenario else None)
    scenario = scenario or Scenario(wiring["name"])
    chosen, wires = _changed(scenario, wiring["components"], wiring["wires"], findings)
    components = {}
    for name, fmu in chosen.items():
        with findings.collecting():
            components[name] = read_component(name, _file_of(name, fmu, folder))
    findings.refuse()
    connections: list[Connection] = []
    for target, source in wires.items():
        with findings.collecting():
            connections += _wire(components, target, source)
    groups = {*wiring["wires"], *scenario.wires, *_left_open(chosen, wiring)}
    left_open = {
        PortName(name, variable.name)
        for name, component in components.items()
        for variable in component.having("input")
        if any(group in groups for group, _ in PortName.splits(f"{name}.{variable.name}"))
    }
    system = System(
        name=wiring["name"],
        components=components,
        connections=tuple(connections),
        left_open=left_open - {connection.target for connection in connections},
        stop_time=wiring["experiment"]["stop_time"],
        step=wiring["experiment"]["step"],
        steps=scenario.steps,
    )
    values: dict[PortName, object] = {}
    for port, value in system.expanded(scenario.parameters).items():
        with findings.collecting():
            system.with_parameters({port: value})
            values[port] = value
    findings.refuse()
    return system.with_parameters(values)


def _file_of(name: str, fmu: str, folder: Path) -> Path:
    """Return the file of a component, given as the name of an FMU of the bundle, or as a path."""
    if fmu.endswith(".fmu"):
        check_built(Path(fmu))
        return Path(fmu)
    path = folder / f"{fmu}.fmu"
    if not path.is_file():
        known = sorted(path.stem for path in folder.glob("*.fmu"))
        hint = did_you_mean(fmu, known) or f"; there are {', '.join(known)}"
        raise InputError(f"{name}: the bundle has no FMU {fmu!r}{hint}")
    return path


def check_built(fmu: Path) -> None:
    """Raise an InputError if an FMU is missing and there is a script to build it from."""
    there = [*fmu.parent.iterdir()] if is_folder(fmu.parent) else []
    for script in () if fmu in there else sorted(there):
        if script.suffix == ".py" and name_of(script.stem).lower() == fmu.stem.lower():
            raise InputError(f"{fmu}: no such file; build it: auv-fmu build {script}")


def _left_open(chosen: Mapping[str, str], wiring: Mapping[str, Any]) -> Iterator[str]:
    """Yield the groups of inputs that the closed loop leaves open, for all components of an FMU."""
    groups = set()
    for target, source in wiring["wires"].items():
        if source is False:
            component = component_of(target, wiring["components"])
            groups.add((wiring["components"][component], target.removeprefix(component)))
    for standard, group in groups:
        yield from (f"{name}{group}" for name, fmu in chosen.items() if fmu == standard)


def _changed(
    scenario: Scenario,
    chosen: Mapping[str, str],
    wires: Mapping[str, str | bool],
    findings: Findings,
) -> tuple[dict[str, str], dict[str, str]]:
    """Apply a scenario to the components and wires of the closed loop."""
    stated = {**chosen, **scenario.components}
    there = {name: str(fmu) for name, fmu in stated.items() if fmu is not False}
    for name in there:
        if not re.fullmatch(r"\w+(\.\w+)*", name):
            findings.problem(
                f"{scenario.name}: component {name!r}: write letters, digits and _ only, and dots "
                "between the names of systems"
            )
        for system, _ in PortName.splits(name):
            if system in there:
                findings.problem(f"{scenario.name}: {system} and {name} cannot both be components")
    for target in scenario.wires.keys() - wires.keys():
        if scenario.wires[target] is False:
            findings.problem(
                f"{scenario.name}: there is no wire {target!r} to remove"
                f"{did_you_mean(target, wires)}"
            )
    wired = {
        target: str(source)
        for target, source in {**wires, **scenario.wires}.items()
        if source is not False
    }
    if missing := set(scenario.only) - there.keys():
        findings.problem(
            f"{scenario.name}: only = {', '.join(sorted(missing))}: no such component; "
            f"there are {', '.join(there)}"
        )
    if scenario.only:
        there = {name: fmu for name, fmu in there.items() if name in scenario.only}
    left = stated.keys() - there.keys()
    return there, {
        target: source
        for target, source in wired.items()
        if left.isdisjoint(component_of(end, stated) for end in (target, source))
    }


def _wire(components: Mapping[str, Component], target: str, source: str) -> list[Connection]:
    """Return the connections of a wire between ports, terminals, or the namesakes of two groups."""
    for name in (target, source):
        PortName.read(name)
    to, start = (component_of(name, components) for name in (target, source))
    group, source_group = target[len(to) + 1 :], source[len(start) + 1 :]
    for name in (to, start):
        if name not in components:
            raise InputError(
                f"wire {source} -> {target}: there is no component {name!r}"
                f"{did_you_mean(name, components)}"
            )
    inputs = [variable.name for variable in components[to].having("input")]
    outputs = components[start].variables
    if group in components[to].variables and source_group in outputs:
        return [Connection(PortName(start, source_group), PortName(to, group))]
    members = _members(inputs, group)
    if not (members and _members(outputs, source_group)):
        end = components[to].terminals.get(group)
        begin = components[start].terminals.get(source_group)
        if end and begin:
            try:
                return list(Connection.of_terminals(components[to], end, components[start], begin))
            except InputError as error:
                raise InputError(f"wire {source} -> {target}: {error}") from None
    if group in inputs and not members:
        raise InputError(
            f"wire {source} -> {target}: {target} is one input, and {start} has no port "
            f"{source_group!r}{did_you_mean(source_group, outputs)}"
        )
    if not members:
        raise InputError(
            f"wire {source} -> {target}: {to} has no input {group} nor inputs {group}.*"
            f'{did_you_mean(group, inputs)}; a scenario removes a wire with "{target}" = false '
            "under [wires]"
        )
    if source_group in outputs and not _members(outputs, source_group):
        raise InputError(
            f"wire {source} -> {target}: {source} is one port, and {target} a group of inputs; "
            f"wire one of them{did_you_mean(group, members)}"
        )
    return [
        Connection(PortName(start, source_group + name.removeprefix(group)), PortName(to, name))
        for name in members
    ]


def _members(ports: Iterable[str], group: str) -> list[str]:
    """The ports of a group."""
    return [name for name in ports if name.startswith((f"{group}.", f"{group}["))]
