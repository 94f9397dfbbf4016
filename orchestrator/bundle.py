"""The bundle: every FMU and the SSP of the closed loop, built when missing or stale."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from uuid import uuid4

from orchestrator.bill_of_materials import BILL, CHECKSUMS, bill, checksums
from orchestrator.errors import InputError, last_line
from orchestrator.scenario import Scenario
from orchestrator.ssp import ssp_bytes
from orchestrator.system import Component, Connection, PortName, System, port_name, read_component

#: Where the bundle is built unless another folder is named.
DEFAULT_FOLDER = Path("fmus", "dist")

#: The archive of the closed loop, and what the FMUs beside it were built from.
ARCHIVE, MANIFEST = "auv.ssp", "build.json"

_WIRING = Path(__file__).parent / "closed_loop.toml"


def build(folder: Path, loader: str | None = None) -> list[Path]:
    """Bring a folder with FMUs and SSP up to date.

    Args:
        folder: made if it does not exist.
        loader: `native` or `plain`; None: what is there, and for new files native where it can be
            compiled.

    Returns:
        The files that had to be written.

    Raises:
        InputError: the folder cannot be written, or the FMUs cannot be built.

    """
    written = run_fmus("packaging.build", folder, *(("--loader", loader) if loader else ()))
    archive = folder / ARCHIVE
    try:
        written += _write_if_changed(archive, ssp_bytes(closed_loop(folder)))
        files = [*sorted(folder.glob("*.fmu")), archive]
        written += _write_if_changed(folder / CHECKSUMS, checksums(files))
        written += _write_if_changed(folder / BILL, bill(files))
    except OSError as error:
        raise InputError(f"cannot write the bundle into {folder}: {error}") from error
    return written


def _write_if_changed(path: Path, content: bytes) -> list[Path]:
    """Write a file at once, so that another run never sees half of it."""
    if path.is_file() and path.read_bytes() == content:
        return []
    partial = path.with_name(f".{path.name}.{uuid4().hex}")
    partial.write_bytes(content)
    partial.replace(path)
    return [path]


def loader_of(folder: Path) -> str:
    """Which loader the FMUs in a folder were built with."""
    content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return str(content["loader"])


def run_fmus(module: str, folder: Path, *options: str) -> list[Path]:
    """Run a module of the package fmus that writes into a folder.

    In a process of its own: what PythonFMU imports to build must not stay in this one. Without -P
    it would import from a folder fmus in the current one.

    Returns:
        The files written.

    Raises:
        InputError: it failed.

    """
    process = subprocess.run(
        [sys.executable, "-P", "-m", f"fmus.{module}", "--out", str(folder), *options],
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode != 0:
        raise InputError(last_line(process.stderr))
    return [Path(line) for line in process.stdout.splitlines()]


def closed_loop(folder: Path, scenario: Scenario | None = None) -> System:
    """The wiring of the closed loop over the FMUs in a folder.

    Args:
        folder: with the built FMUs.
        scenario: whose components, wires and parameters change it; None: the closed loop as is.

    Raises:
        InputError: a component or group of ports that the scenario names does not exist.

    """
    wiring = tomllib.loads(_WIRING.read_text(encoding="utf-8"))
    chosen, wires = wiring["components"], wiring["wires"]
    parameters: Mapping[PortName, Any] = {}
    if scenario is not None:
        chosen, wires = chosen | scenario.components, wires | scenario.wires
        parameters = scenario.parameters
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
        name: read_component(name, Path(fmu) if fmu.endswith(".fmu") else folder / f"{fmu}.fmu")
        for name, fmu in chosen.items()
    }
    return System(
        name=wiring["name"],
        components=components,
        connections=tuple(
            connection
            for target, source in wires.items()
            for connection in _wire(components, target, source)
        ),
        parameters=parameters,
        stop_time=wiring["experiment"]["stop_time"],
        step=wiring["experiment"]["step"],
    )


def _wire(components: Mapping[str, Component], target: str, source: str) -> list[Connection]:
    """The connections of one wire: every input of the target group takes its namesake."""
    to, group = port_name(target).component, port_name(target).port
    start, source_group = port_name(source).component, port_name(source).port
    for name in (to, start):
        if name not in components:
            raise InputError(f"wire {source} -> {target}: there is no component {name!r}")
    inputs = [
        variable.name
        for variable in components[to].description.modelVariables
        if variable.causality == "input" and variable.name.startswith(f"{group}.")
    ]
    if not inputs:
        raise InputError(f"wire {source} -> {target}: {to} has no inputs {group}.*")
    return [
        Connection(PortName(start, source_group + name.removeprefix(group)), PortName(to, name))
        for name in inputs
    ]
