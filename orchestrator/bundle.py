"""The bundle: every FMU and the SSP of the closed loop, built when missing or stale."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from uuid import uuid4

from orchestrator.errors import InputError
from orchestrator.ssp import ssp_bytes
from orchestrator.system import Connection, PortName, System, read_component

#: Where the bundle is built unless another folder is named.
DEFAULT_FOLDER = Path("fmus", "dist")

#: The archive of the closed loop.
ARCHIVE = "auv.ssp"

_WIRING = Path(__file__).parent / "closed_loop.toml"


def build(folder: Path) -> list[Path]:
    """Bring a folder with FMUs and SSP up to date.

    Returns:
        The files that had to be written.

    Raises:
        InputError: the folder cannot be written, or the FMUs cannot be built.

    """
    # In a process of its own: what PythonFMU imports to build must not stay in this one. Without
    # -P it would import from a folder fmus in the current one.
    process = subprocess.run(
        [sys.executable, "-P", "-m", "fmus.build", "--out", str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode != 0:
        lines = process.stderr.strip().splitlines() or ["no reason given"]
        raise InputError(lines[-1])
    written = [Path(line) for line in process.stdout.splitlines()]
    archive = folder / ARCHIVE
    content = ssp_bytes(closed_loop(folder))
    try:
        if not archive.is_file() or archive.read_bytes() != content:
            partial = archive.with_name(f".{ARCHIVE}.{uuid4().hex}")
            partial.write_bytes(content)
            partial.replace(archive)
            written.append(archive)
    except OSError as error:
        raise InputError(f"cannot write {archive}: {error}") from error
    return written


def closed_loop(folder: Path) -> System:
    """The wiring of the closed loop over the FMUs in a folder."""
    wiring = tomllib.loads(_WIRING.read_text(encoding="utf-8"))
    components = {
        name: read_component(name, folder / f"{fmu}.fmu")
        for name, fmu in wiring["components"].items()
    }
    connections = []
    for target, source in wiring["wires"].items():
        target_component, group = target.split(".")
        source_component, source_group = source.split(".")
        connections += [
            Connection(
                PortName(source_component, source_group + variable.name.removeprefix(group)),
                PortName(target_component, variable.name),
            )
            for variable in components[target_component].description.modelVariables
            if variable.causality == "input" and variable.name.startswith(f"{group}.")
        ]
    return System(
        name=wiring["name"],
        components=components,
        connections=tuple(connections),
        stop_time=wiring["experiment"]["stop_time"],
        step=wiring["experiment"]["step"],
    )
