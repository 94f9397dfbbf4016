"""FMUs in a host in C, without Python: each on its own, with its inputs in a run here."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from orchestrator.cosim import Experiment, System, Table
from orchestrator.machine.compilers import machines_compiler

#: Letters of the host for the types of FMI.
_LETTERS = {"Real": "R", "Integer": "I", "Enumeration": "I", "Boolean": "B"}

SOURCE = Path(__file__).parents[1] / "fmu" / "replay.c"


def compile_replay(folder: Path, command: Sequence[str] = (), name: str = "replay") -> Path:
    """Compile the host, by this machine's compiler or another one."""
    compiler = [*command] or [str(machines_compiler())]
    options = ["-Wall", "-Wextra", "-std=c99", "-o", str(folder / name), str(SOURCE)]
    # For Windows as the libraries: ziglang makes a C library for every level, which takes minutes.
    # Until glibc 2.34, dlopen is in a separate library.
    options.append("-Os" if name.endswith(".exe") else "-ldl")
    subprocess.run([*compiler, *options], check=True)
    return folder / name


def replay(
    command: Sequence[str | Path],
    folder: str | Path,
    library: str,
    system: System,
    name: str,
    table: Table,
    experiment: Experiment,
) -> tuple[np.ndarray, np.ndarray]:
    """Run a component by a host.

    Args:
        command: that starts the host.
        folder: of the unpacked FMU, as the host sees it.
        library: in that folder.
        system: that the component belongs to.
        name: of the component.
        table: of a run of the system.
        experiment: that run.

    Returns:
        The Real outputs that the host has written, and those of the run.

    """
    component = system.components[name]
    inputs, outputs = (
        [port for port in component.having(causality) if port.type == "Real"]
        for causality in ("input", "output")
    )
    settings = [
        f"{_LETTERS[component.variable(port).type]} {component.variable(port).reference} "
        f"{float(value)!r}"
        for port, value in system.parameters_of(name).items()
    ]
    given, expected = (
        np.array([table[f"{name}.{port.name}"] for port in ports]).T for ports in (inputs, outputs)
    )
    rows = given.tolist() if inputs else []
    lines = [
        f"{experiment.step!r} {experiment.full_steps} {len(settings)}",
        *settings,
        f"{len(inputs)} {len(outputs)}",
        " ".join(str(port.reference) for port in (*inputs, *outputs)),
        *(" ".join(map(repr, row)) for row in rows),
    ]
    uri = f"file://{'' if str(folder).startswith('/') else '/'}{folder}/resources"
    process = subprocess.run(
        [*map(str, command), f"{folder}/{library}", str(component.description.guid), uri],
        input="\n".join(lines) + "\n", capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    found = [[*map(float, line.split())] for line in process.stdout.splitlines()]
    return np.array(found), expected
