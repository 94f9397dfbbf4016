"""A system as one FMU that contains the others."""

from __future__ import annotations

import json
import shutil
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from orchestrator.machine.children import run_module
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, last_line
from orchestrator.system.names import file_name
from orchestrator.system.structure import System

_TOOLBOX = "fmu_manipulation_toolbox"

#: The file that says what is in a container.
_CONTENT = "system.json"


def write_container(system: System, folder: Path) -> list[Path]:
    """Write `NAME.fmu`, one FMU that contains the whole system and shows all its outputs.

    Raises:
        InputError: the FMU manipulation toolbox is not installed, or fails, or the system has what
            a container has not.

    """
    if any(connection.transformation for connection in system.connections) or system.steps:
        raise InputError("a container has no transformations and one step; write an SSP")
    if find_spec(_TOOLBOX) is None:
        raise InputError(
            "a container needs the FMU manipulation toolbox: pip install 'auv-fmu[hosts]'"
        )
    container = f"{file_name(system.name)}.fmu"
    names = system.fmus(container, _CONTENT)
    fmus = {component.name: names[component.fmu] for component in system.components.values()}
    if len(names) < len(fmus):
        raise InputError("a container takes each FMU once; this system has one twice")
    content: dict[str, Any] = {
        "name": container,
        "step_size": system.step,
        "auto_link": False,
        "auto_input": False,
        "auto_output": False,
        "auto_parameter": False,
        "fmu": list(fmus.values()),
        "link": [
            [fmus[c.source.component], c.source.port, fmus[c.target.component], c.target.port]
            for c in system.connections
        ],
        "output": [
            [fmus[component.name], variable.name, f"{component.name}.{variable.name}"]
            for component in system.components.values()
            for variable in component.description.modelVariables
            if variable.causality == "output"
        ],
        "start": [
            [fmus[name], port, value]
            for name in system.components
            for port, value in system.parameters_of(name).items()
        ],
    }
    with TemporaryDirectory(dir=process_folder()) as work:
        for fmu, name in names.items():
            shutil.copyfile(fmu, Path(work, name))
        Path(work, _CONTENT).write_text(json.dumps(content), encoding="utf-8")
        versions = {component.description.fmiVersion for component in system.components.values()}
        fmi = max(versions).partition(".")[0]
        options = ["-container", _CONTENT, "-fmu-directory", work, "-fmi", fmi]
        process = run_module(f"{_TOOLBOX}.cli.fmucontainer", *options, folder=Path(work))
        built = Path(work, container)
        if process.returncode != 0 or not built.is_file():
            raise InputError(
                f"the container was not built: {last_line(process.stderr + process.stdout)}"
            )
        path = folder / built.name
        shutil.copyfile(built, path)
    return [path]
