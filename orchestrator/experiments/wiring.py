"""The wiring of the closed loop: which FMUs there are, and which ports feed which."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.errors import InputError, did_you_mean
from orchestrator.experiments.scenario import Scenario
from orchestrator.system.component import RUNNABLE, Component, read_component
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import Connection, System

_WIRING = Path(__file__).with_name("closed_loop.toml")


def read_wiring() -> dict[str, Any]:
    """What `closed_loop.toml` holds."""
    return tomllib.loads(_WIRING.read_text(encoding="utf-8"))


def closed_loop(
    folder: Path, scenario: Scenario | None = None, versions: Sequence[str] = RUNNABLE
) -> System:
    """The wiring of the closed loop over the FMUs in a folder.

    Args:
        folder: with the built FMUs.
        scenario: whose components, wires and parameters change it; None: the closed loop as is.
        versions: of FMI that its FMUs may have.

    Raises:
        InputError: a component or group of ports that the scenario names does not exist.

    """
    wiring = read_wiring()
    chosen, wires = wiring["components"], wiring["wires"]
    if scenario is not None:
        chosen = chosen | scenario.components
        for name in chosen:
            if not re.fullmatch(r"\w+", name):
                raise InputError(
                    f"{scenario.name}: component {name!r}: write letters, digits and _ alone"
                )
        for target in scenario.wires.keys() - wires.keys():
            if scenario.wires[target] is False:
                raise InputError(
                    f"{scenario.name}: there is no wire {target!r} to remove"
                    f"{did_you_mean(target, wires)}"
                )
        wires = {
            target: source
            for target, source in (wires | scenario.wires).items()
            if source is not False
        }
        missing = set(scenario.only) - chosen.keys()
        if missing:
            raise InputError(
                f"{scenario.name}: only = {', '.join(sorted(missing))}: no such component; "
                f"there are {', '.join(chosen)}"
            )
        if scenario.only:
            chosen = {name: fmu for name, fmu in chosen.items() if name in scenario.only}
            wires = {
                target: source
                for target, source in wires.items()
                if {target.split(".")[0], source.split(".")[0]} <= chosen.keys()
            }
    components = {
        name: read_component(
            name, Path(fmu) if fmu.endswith(".fmu") else folder / f"{fmu}.fmu", versions
        )
        for name, fmu in chosen.items()
    }
    system = System(
        name=wiring["name"],
        components=components,
        connections=tuple(
            connection
            for target, source in wires.items()
            for connection in _wire(components, target, source)
        ),
        stop_time=wiring["experiment"]["stop_time"],
        step=wiring["experiment"]["step"],
    )
    if scenario is None:
        return system
    return replace(system.with_parameters(scenario.parameters), steps=scenario.steps)


def _wire(components: Mapping[str, Component], target: str, source: str) -> list[Connection]:
    """The connections of one wire: every input of the target group takes its namesake."""
    to, group = port_name(target).component, port_name(target).port
    start, source_group = port_name(source).component, port_name(source).port
    for name in (to, start):
        if name not in components:
            raise InputError(f"wire {source} -> {target}: there is no component {name!r}")
    inputs = [
        variable.name
        for variable in components[to].having("input")
        if variable.name.startswith(f"{group}.")
    ]
    if not inputs:
        raise InputError(
            f"wire {source} -> {target}: {to} has no inputs {group}.*; a scenario removes a wire "
            f'with "{target}" = false under [wires]'
        )
    return [
        Connection(PortName(start, source_group + name.removeprefix(group)), PortName(to, name))
        for name in inputs
    ]
