"""A host that is a C program: `host.c` beside this file, compiled with the system it runs."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from fmpy.model_description import ScalarVariable

from fmus.compilers import COMPILERS, LIMIT_OF_ZIG, machines_compiler, run_compiler
from orchestrator.formats.tables import read_columns, read_rows
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.master.experiment import FEEDTHROUGH, GAUSS_SEIDEL, Experiment
from orchestrator.master.fmi.binary import binary_of
from orchestrator.master.plan import gathered_connections, stages
from orchestrator.system.component import Component
from orchestrator.system.connection import Connection
from orchestrator.system.graph import rings
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from orchestrator.system.values import Value

#: The program.
HOST_SOURCE = Path(__file__).with_name("host.c")

#: What the host is compiled with, and what it writes.
PLAN_FILE, TABLE_FILE = "plan.h", "table.csv"

#: Where the library of an unpacked FMU is.
LibraryOf = Callable[[Component], Path]


def _library_of(component: Component) -> Path:
    """The library of an FMU for this machine, unpacked."""
    return binary_of(component, component.folder)


def compile_host(
    folder: Path,
    system: System,
    experiment: Experiment,
    library: LibraryOf = _library_of,
    command: Sequence[str] = (),
    name: str = "host",
) -> Path:
    """Compile the host of a system.

    Args:
        folder: where it is put.
        system: to run; its connections are of Reals.
        experiment: whose steps are all of one length. Without an order it is `feedthrough`, or
            `gauss-seidel` where there are rings; outputs are taken to follow inputs between steps.
        library: where the library of an FMU is; beside its folder `binaries` is `resources`.
        command: of a C compiler; empty: this machine's.
        name: of the program.

    Raises:
        InputError: the host cannot make such a run, there is no compiler, or it fails.

    """
    found = command or (machines_compiler(),)
    if found[0] is None:
        raise InputError(f"there is no C compiler: neither {' nor '.join(COMPILERS)}")
    (folder / PLAN_FILE).write_text(_plan(system, experiment, library), encoding="utf-8")
    program = folder / name
    is_windows = program.suffix == ".exe"
    # For Windows as the libraries: ziglang makes a C library for every level, which takes minutes.
    options = ["-std=c99", "-ffp-contract=off", "-Os" if is_windows else "-O2", f"-I{folder}"]
    options += ["-o", str(program), str(HOST_SOURCE)]
    if not is_windows:
        options.append("-ldl")  # until glibc 2.34, dlopen is in a separate library
    try:
        process = run_compiler([*found, *options], limit=LIMIT_OF_ZIG if command else None)
    except OSError as error:
        raise InputError(f"{HOST_SOURCE.name} does not compile: {reason(error)}") from error
    if process.returncode != 0:
        raise InputError(f"{HOST_SOURCE.name} does not compile: {last_line(process.stderr)}")
    return program


def _plan(system: System, experiment: Experiment, library: LibraryOf) -> str:
    """What the host is compiled with: FMUs and members in the order of the stages."""
    if system.steps or any(connection.transformation for connection in system.connections):
        raise InputError(
            "the C program supports neither longer steps of components nor transformations"
        )
    closed = rings(system)
    order = experiment.order or (GAUSS_SEIDEL if closed else FEEDTHROUGH)
    if closed and order == FEEDTHROUGH:
        raise InputError(f"the C program solves no rings; leave out order {FEEDTHROUGH}")
    parts = stages(system, order)
    columns: dict[PortName, int] = {}
    references: list[int] = []
    fmus, parameters, row = [], [], []
    numbers = {name: number for number, name in enumerate(chain(*parts))}
    for name, number in numbers.items():
        component = system.components[name]
        path = library(component)
        fmu = {
            "name": _text(name),
            "guid": _text(component.description.guid),
            "resources": _text((path.parents[2] / "resources").as_uri()),
            "path": _text(str(path)),
        }
        for causality in ("input", "output"):
            ports = [port for port in component.having(causality) if port.type == "Real"]
            first = len(columns)
            place = f"row + {first}"
            where = {"references": f"references + {first}", "row": place, "values": place}
            fmu[f"{causality}s"] = _struct(**where, n_references=len(ports), n=len(ports))
            columns |= {PortName(name, port.name): first + i for i, port in enumerate(ports)}
            references += [port.valueReference for port in ports]
            row += [_initial(system, name, port.name) for port in ports]
        fmus.append(_struct(**fmu))
        for parameter, value in system.parameters_of(name).items():
            parameters.append(_setting(f"&fmus[{number}]", component.variable(parameter), value))
    whole = {name: _struct(of=numbers[name], sets=1, steps=1, gets=1) for name in numbers}
    acting = [[whole[name] for name in names] for names in parts]
    shown_after = len(parts)
    takings = [system.connections, *gathered_connections(system, parts, order=order)]
    if order == FEEDTHROUGH:
        # Values pass through what has feedthrough, a row shows them, and all are stepped.
        direct = {
            name
            for name, component in system.components.items()
            if any(component.has_feedthrough(port.name) for port in component.having("output"))
        }
        passing = {name: _struct(of=numbers[name], sets=1, gets=1) for name in direct}
        # States that something takes before they pass are read after the step.
        positions = {name: i for i, names in enumerate(parts) for name in names}
        wires = [(one.source.component, one.target.component) for one in system.connections]
        early = {source for source, target in wires if positions[source] >= positions[target]}
        stepping = {
            name: _struct(of=numbers[name], steps=1, gets=int(name in early)) for name in direct
        }
        acting = [[passing[name] for name in names if name in direct] for names in parts]
        acting.append([*(whole | stepping).values()])
        takings.append([])
    copies: list[Connection] = []
    found: list[str] = []
    actions: list[str] = []
    for acts, taken in zip([[], *acting], takings, strict=True):
        what = {"targets": f"targets + {len(copies)}", "sources": f"sources + {len(copies)}"}
        what |= {"factors": "ones", "offsets": "zeros", "members": f"members + {len(actions)}"}
        counts = {"n_connections": len(taken), "n_members": len(acts), "every": 1}
        found.append(_struct(**what, **counts))
        copies += taken
        actions += acts
    connections, *stages_of_a_step = found
    return f"""\
enum {{ FMUS = {len(fmus)}, COLUMNS = {len(columns)}, MEMBERS = {len(actions)} }};
enum {{ SHOWN_AFTER = {shown_after} }};
static const double START = {experiment.start_time!r}, STEP = {experiment.step!r};
static const char header[] = {_text(",".join(("time", *map(str, columns))))};
static double row[COLUMNS] = {_listed(row)};
static const reference references[] = {_listed(references)};
static fmu fmus[] = {_listed(fmus)};
static const action actions[] = {_listed(actions)};
static member members[MEMBERS];
static const size_t targets[] = {_listed(columns[copy.target] for copy in copies)};
static const size_t sources[] = {_listed(columns[copy.source] for copy in copies)};
static const double ones[] = {_listed(1.0 for _ in copies)}, zeros[{len(copies)}];
static const stage connections = {connections};
static const stage stages[] = {_listed(stages_of_a_step)};
static void set_parameters(void) {{ {" ".join(parameters)} }}
"""


def _initial(system: System, name: str, port: str) -> float:
    """What an input is at the start if nothing is connected to it."""
    set_to = system.parameters_of(name).get(port)
    value = system.components[name].start(port) if set_to is None else set_to
    return float(value or 0.0)


def _listed(items: Iterable[object]) -> str:
    return f"{{{', '.join(map(str, items))}}}"


def _struct(**members: object) -> str:
    return _listed(f".{name} = {value}" for name, value in members.items())


def _text(value: str) -> str:
    """A string of C, whatever is in it."""
    safe = (chr(b) if chr(b).isalnum() and b < 128 else f"\\{b:03o}" for b in value.encode())
    return f'"{"".join(safe)}"'


def _setting(fmu: str, variable: ScalarVariable, value: Value) -> str:
    """The call that sets a parameter."""
    match variable.type:
        case "Real":
            return f"set_real({fmu}, {variable.valueReference}, {float(value)!r});"
        case "String":
            return f"set_string({fmu}, {variable.valueReference}, {_text(str(value))});"
        case kind:
            name = "fmi2SetBoolean" if kind == "Boolean" else "fmi2SetInteger"
            return f'set_integer({fmu}, "{name}", {variable.valueReference}, {int(value)});'


def run_host(
    command: Sequence[str | Path], folder: Path, steps: int, names: Sequence[str]
) -> tuple[np.ndarray, float]:
    """Run the host.

    Args:
        command: that starts it.
        folder: where it is started, for :data:`TABLE_FILE`.
        steps: how many.
        names: of the columns that are wanted.

    Returns:
        Their rows, that at the start too, and the seconds of the steps.

    Raises:
        InputError: it fails.

    """
    process = subprocess.run(
        [*command, str(steps), TABLE_FILE],
        cwd=folder, capture_output=True, text=True, errors="replace", check=False,
    )  # fmt: skip
    if process.returncode != 0:
        raise InputError(last_line(process.stderr, f"exit status {process.returncode}"))
    place = {name: i for i, name in enumerate(read_columns(folder / TABLE_FILE), start=1)}
    rows = np.vstack([*read_rows(folder / TABLE_FILE)])
    return rows[:, [place[name] for name in names]], float(process.stdout)
