"""A host that is a C program: `host.c` beside this file, and the plan that it runs."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np

from orchestrator.machine.compiler import COMPILERS, LIMIT_OF_ZIG, machines_compiler, run_compiler
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.master.experiment import Experiment
from orchestrator.master.plan import gathered, stages
from orchestrator.system.component import Component
from orchestrator.system.names import PortName
from orchestrator.system.structure import Connection, System
from orchestrator.system.values import Value

SOURCE = Path(__file__).with_name("host.c")

#: What the host reads and writes.
PLAN, TABLE = "plan.txt", "table.csv"

#: Where the library of an unpacked FMU is.
Library = Callable[[Component], Path]


def compiled(folder: Path, command: Sequence[str] = (), name: str = "host") -> Path:
    """The host as a program.

    Args:
        folder: where it is put.
        command: of a C compiler; empty: this machine's.
        name: of the program.

    Raises:
        InputError: there is no compiler, or it fails.

    """
    found = command or (machines_compiler(),)
    if found[0] is None:
        raise InputError(f"there is no C compiler: neither {' nor '.join(COMPILERS)}")
    program = folder / name
    is_windows = program.suffix == ".exe"
    # For Windows as the libraries: ziglang makes a C library for every level, which takes minutes.
    options = ["-std=c99", "-Os" if is_windows else "-O2", "-o", str(program), str(SOURCE)]
    if not is_windows:
        options.append("-ldl")  # until glibc 2.34, dlopen is in a library of its own
    try:
        process = run_compiler([*found, *options], LIMIT_OF_ZIG if command else None)
    except OSError as error:
        raise InputError(f"{SOURCE.name} does not compile: {reason(error)}") from error
    if process.returncode != 0:
        raise InputError(f"{SOURCE.name} does not compile: {last_line(process.stderr)}")
    return program


def library_of(component: Component) -> Path:
    """The library of an FMU for this machine, unpacked."""
    identifier = component.description.coSimulation.modelIdentifier
    return component.folder / "binaries" / "linux64" / f"{identifier}.so"


def plan(system: System, experiment: Experiment, library: Library = library_of) -> str:
    """What the host is to do, as it reads it.

    Args:
        system: to run; its connections are of Reals.
        experiment: whose steps are all of one length.
        library: where the library of an FMU is; beside its folder `binaries` is `resources`.

    Raises:
        InputError: it asks for what the host does not do.

    """
    if system.steps or any(connection.transformation for connection in system.connections):
        raise InputError("the C program has one step for all components, and no transformations")
    columns: dict[PortName, int] = {}
    lines = [f"step {experiment.step!r}", f"steps {experiment.full_steps}"]
    for component in system.components.values():
        lines += _fmu(component, library(component), system.parameters_of(component.name))
        for causality in ("input", "output"):
            for port in component.having(causality):
                if port.type == "Real":
                    columns[PortName(component.name, port.name)] = len(columns)
                    lines.append(f"{causality} {port.valueReference} {port.name}")

    def copies(word: str, connections: Sequence[Connection]) -> Iterator[str]:
        return (f"{word} {columns[c.target]} {columns[c.source]}" for c in connections)

    lines += copies("connect", system.connections)
    number = dict(zip(system.components, count()))
    parts = stages(system, experiment.order)
    for names, taken in zip(parts, gathered(system, parts), strict=True):
        lines += ["stage", *copies("gather", taken), *(f"member {number[n]}" for n in names)]
    return "\n".join(lines) + "\n"


def _fmu(component: Component, library: Path, values: dict[str, Value]) -> Iterator[str]:
    yield f"fmu {component.name}"
    yield f"guid {component.description.guid}"
    yield f"resources {(library.parents[2] / 'resources').as_uri()}"
    yield f"library {library}"
    for name, value in values.items():
        variable = component.variable(name)
        text = int(value) if isinstance(value, bool) else value
        yield f"{variable.type.lower()} {variable.valueReference} {text}"


def run(
    command: Sequence[str | Path], folder: Path, what: str, names: Sequence[str]
) -> tuple[np.ndarray, float]:
    """Run the host.

    Args:
        command: that starts it.
        folder: where it is started, for :data:`PLAN` and :data:`TABLE`.
        what: the plan.
        names: of the columns that are wanted.

    Returns:
        Their rows, that at the start too, and the seconds of the steps.

    Raises:
        InputError: it fails.

    """
    (folder / PLAN).write_text(what, encoding="utf-8")
    process = subprocess.run(
        [*command, PLAN, TABLE],
        cwd=folder, capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    if process.returncode != 0:
        raise InputError(last_line(process.stderr, f"exit status {process.returncode}"))
    with (folder / TABLE).open(encoding="utf-8") as lines:
        header = lines.readline().strip().split(",")
        rows = np.loadtxt(lines, delimiter=",", ndmin=2)
    return rows[:, [header.index(name) for name in names]], float(process.stdout)
