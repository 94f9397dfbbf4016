"""Other co-simulation tools (hosts): run the bundle in each, and compare with our own master.

Each host runs in a process of its own: some leave threads running, or end the process when they
fail. `python -m orchestrator.exchange.hosts TOOL FOLDER` runs a tool that is installed next to this
program. A tool with pinned packages runs in an environment in the user's cache folder, made when it
is first needed, by :mod:`.drivers`: some need versions of packages that conflict, and some are
large.
"""

from __future__ import annotations

import csv
import ctypes
import importlib
import json
import os
import pickle
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from sysconfig import get_path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from fmpy.ssp.simulation import simulate_ssp
from tqdm import tqdm

from orchestrator.cosim import Experiment, System, Table, write_osp, write_ssp
from orchestrator.exchange import drivers
from orchestrator.exchange.drivers import write_rows
from orchestrator.exchange.verify import ways
from orchestrator.machine.cache import category_folder
from orchestrator.machine.children import run_module
from orchestrator.machine.disk import hold_lock, temporary_folder
from orchestrator.machine.errors import InputError, last_line, reason

#: Name of the parameter set that ecos applies.
_PARAMETER_SET = "scenario"

#: Largest deviation that is rounding: many tools add up their time.
BOUND = 1e-9

#: Time limit of a host's run [s].
_TIMEOUT = 600

#: Versions of FMI that a host runs.
_FMI_2, _BOTH = ("2.0",), ("2.0", "3.0")

#: In the folder of a run: the pickled system and experiment, files for the tool, and the result.
_GIVEN, _EXPORT, _ROWS = "given", "export", "rows.csv"

#: Floating-point types of FMI 2.0 and 3.0.
_NUMBERS = ("Real", "Float64")

#: Category of the environments in the user's cache folder.
_CATEGORY = "hosts"

#: File that marks a finished environment.
_WHOLE = "auv-fmu-whole"

#: Without `--retries 1`, pip would try for minutes without a network.
_PIP = ("-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--retries", "1")

#: In pip's warning when it reaches no index; its last line then reports a missing package.
_UNREACHED = "connection broken by"

#: Length at which lines of pip are cut for display.
_SHOWN = 60


@dataclass(frozen=True)
class Host:
    """A tool that can run the bundle.

    Attributes:
        package: name of its package.
        run: the function that runs it, of this module or of :mod:`.drivers`.
        fmi: versions of FMI that it runs.
        order: order in which it steps the components, as for `auv-fmu verify`.
        initial: values that it exchanges before the first step, as for `auv-fmu verify`.
        turned: if set, outputs are read after values were passed on.
        pins: pip requirements of its own environment; empty: it runs in the present one.

    """

    package: str
    run: Callable[..., Any]
    fmi: Sequence[str] = _FMI_2
    order: str = "jacobi"
    initial: str = "full"
    turned: bool = False
    pins: Sequence[str] = ()

    def label(self) -> str | None:
        """Return the package with its version, or None if it is not installed."""
        if self.pins:
            return f"{self.package} {self.pins[0].partition('==')[2]}"
        try:
            return f"{self.package} {version(self.package)}"
        except PackageNotFoundError:
            return None


@dataclass(frozen=True)
class HostVerdict:
    """Result of a host.

    Attributes:
        host: key of :data:`HOSTS`.
        package: its package with the version.
        deviation, port: the largest deviation, and its port.
        steps_per_second: speed of the tool.
        rows_per_second: speed with every output read after each step.
        failure: why it did not run; None: it ran.

    """

    host: str
    package: str
    deviation: float = float("nan")
    port: str = ""
    steps_per_second: float = float("nan")
    rows_per_second: float = float("nan")
    failure: str | None = None

    @property
    def agrees(self) -> bool:
        """True if it ran and deviates by no more than rounding."""
        return self.deviation <= BOUND


class HostRun(NamedTuple):
    """A run in a host.

    Attributes:
        rows: all Real outputs, a row per step.
        seconds: time of the steps [s].
        reading: time of reading the rows, for a tool that does not record them itself [s].

    """

    rows: np.ndarray
    seconds: float
    reading: float = 0.0


def real_outputs(system: System) -> list[tuple[str, str, int]]:
    """Return component, port and value reference of every Real output."""
    return [
        (component.name, variable.name, variable.reference)
        for component in system.components.values()
        for variable in component.having("output")
        if variable.type in _NUMBERS
    ]


def fmi_of(system: System) -> str:
    """Return the newest version of FMI among the FMUs of a system."""
    return max(str(component.description.fmiVersion) for component in system.components.values())


def check_parameters(system: System, host: str) -> None:
    """Check that no parameter differs from its FMU's own value, for hosts that cannot set any.

    Raises:
        InputError: one differs.

    """
    for name, value in system.changed().items():
        raise InputError(f"{host} cannot set parameters, and the system has {name} = {value}")


def check_choices(system: System, host: str) -> None:
    """Check the same for Enumerations only, for hosts that cannot set these."""
    for name, value in system.changed("Enumeration").items():
        raise InputError(f"{host} cannot set choices, and the system has {name} = {value}")


def _names(system: System, between: str = ".") -> list[str]:
    """Return the names of all Real outputs, with a separator between component and port."""
    return [f"{component}{between}{port}" for component, port, _ in real_outputs(system)]


def _stepped(
    step: Callable[[], object], read: Callable[[], list[float]], experiment: Experiment
) -> HostRun:
    """Step a tool and read its outputs after each step, with separate times."""
    rows, seconds, reading = [], 0.0, 0.0
    for _ in range(experiment.rows - 1):
        start = perf_counter()
        step()
        stepped = perf_counter()
        rows.append(read())
        seconds += stepped - start
        reading += perf_counter() - stepped
    return HostRun(np.array(rows), seconds, reading)


def _libcosim(system: System, experiment: Experiment, opener: str, **path: str) -> HostRun:
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # noqa: PLC0415
    from libcosimpy.CosimObserver import CosimObserver  # noqa: PLC0415

    log_output_level(CosimLogLevel.ERROR)
    execution = getattr(CosimExecution, opener)(**path)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    references: dict[str, list[int]] = {}
    for component, _, reference in real_outputs(system):
        references.setdefault(component, []).append(reference)
    index = {name: execution.slave_index_from_instance_name(name) for name in references}

    def step() -> None:
        if not execution.step():
            raise InputError("libcosim ended the run")

    def read() -> list[float]:
        return [
            value
            for name, numbers in references.items()
            for value in observer.last_real_values(index[name], numbers)
        ]

    return _stepped(step, read, experiment)


def libcosim_ssp(system: System, experiment: Experiment, folder: Path) -> HostRun:
    check_choices(system, "libcosim")
    # libcosim and ecos read only the components of the outermost system of an SSP.
    system = system.flattened()
    [path] = write_ssp(system, folder, flat=True)
    return _libcosim(system, experiment, "from_ssp_file", ssp_path=str(path))


def libcosim_osp(system: System, experiment: Experiment, folder: Path) -> HostRun:
    write_osp(system, folder)
    return _libcosim(system, experiment, "from_osp_config_file", osp_path=str(folder))


def ecos(system: System, experiment: Experiment, folder: Path) -> HostRun:
    if experiment.start_time != 0.0:
        # ecos passes a start time to the FMUs, and still steps them from 0 s.
        raise InputError(f"ecos can start at 0 s only, not at {experiment.start_time:g} s")
    check_choices(system, "ecos")
    # The loader does not search the folder in which the wheel tbb installs libtbb for ecospy.
    for library in Path(sys.prefix, "lib").glob("libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    ecospy = importlib.import_module("ecospy")
    system = system.flattened()
    names = _names(system, "::")
    parameter_set = {"parameter_set": _PARAMETER_SET} if system.parameters else {}
    with _ecos_simulation(ecospy, system, experiment, folder) as simulation:
        simulation.init(**parameter_set)
        return _stepped(simulation.step, lambda: [*map(simulation.get_real, names)], experiment)


def _ecos_simulation(ecospy: Any, system: System, experiment: Experiment, folder: Path) -> Any:
    """Make a simulation of ecos: of an SSP, or by its calls for FMI 3.0, as it reads no SSP 2.0."""
    if fmi_of(system) == "2.0":
        # ecos makes one instance per file: each component needs its own copy of the FMU.
        [path] = write_ssp(system, folder, flat=True, parameter_set=_PARAMETER_SET)
        return ecospy.EcosSimulation(experiment.step, ssp_path=str(path))
    structure = ecospy.EcosSimulationStructure()
    for name, component in system.components.items():
        structure.add_model(name, shutil.copyfile(component.fmu, folder / f"{name}.fmu"))
    for connection in system.connections:
        ends = connection.source, connection.target
        source, target = (f"{end.component}::{end.port}" for end in ends)
        structure.make_real_connection(source, target)
    values = {f"{name.component}::{name.port}": x for name, x in system.parameters.items()}
    structure.add_parameter_set(_PARAMETER_SET, values)
    return ecospy.EcosSimulation(experiment.step, structure=structure)


def fmpy_ssp(system: System, experiment: Experiment, folder: Path) -> HostRun:
    check_parameters(system, "fmpy.ssp")
    [path] = write_ssp(system, folder)
    start_time, step = experiment.start_time, experiment.step
    start = perf_counter()
    # fmpy accumulates its time, so rounding decides whether the last step is made: ask for half a
    # step more.
    table = simulate_ssp(str(path), start_time, experiment.stop_time + 0.5 * step, step)
    seconds = perf_counter() - start
    # fmpy's row at a time holds the outputs of the step that begins then.
    rows = np.column_stack([table[name] for name in _names(system)])
    return HostRun(rows[: experiment.rows - 1], seconds)


_PLANNER_FIRST = "planner,plant+controller+disturbance"

#: Hosts by their names on the command line, those with pins last.
HOSTS: dict[str, Host] = {
    "libcosim-ssp": Host("libcosimpy", libcosim_ssp),
    "libcosim-osp": Host("libcosimpy", libcosim_osp),
    "ecos": Host("ecospy", ecos, _BOTH, turned=True),
    "fmpy": Host("fmpy", drivers.fmpy_slaves, _BOTH),
    "fmpy-ssp": Host("fmpy", fmpy_ssp, initial="zero"),
    "cofmupy": Host(
        "cofmupy", drivers.cofmupy, _BOTH, _PLANNER_FIRST, "zero", pins=["cofmupy==1.0.0"]
    ),
    "fmuloader": Host("fmuloader", drivers.fmuloader, _BOTH, pins=["fmuloader==0.1.2rc0"]),
    "gemseo-fmu": Host(
        "gemseo-fmu", drivers.gemseo_fmu, _BOTH, _PLANNER_FIRST, "zero", pins=["gemseo-fmu==3.1.1"]
    ),
    "pathsim-fmi": Host(
        "pathsim-fmi",
        drivers.pathsim_fmi,
        _BOTH,
        "plant,controller,disturbance,planner",
        "none",
        pins=["pathsim-fmi==0.1.1", "pathsim==0.27.1"],
    ),
    "pycosimlibrary": Host(
        "PyCosimLibrary",
        drivers.pycosimlibrary,
        initial="none",
        turned=True,
        pins=["PyCosimLibrary==0.0.5", "fmpy==0.2.14"],
    ),
    "sdf4sim": Host("sdf4sim", drivers.sdf4sim, initial="zero", pins=["sdf4sim==0.6.0"]),
    "sofirpy": Host(
        "sofirpy", drivers.sofirpy, initial="zero", turned=True, pins=["sofirpy==1.0.2"]
    ),
    "syssimx": Host(
        "syssimx",
        drivers.syssimx_gauss_seidel,
        order="planner,plant,controller,disturbance",
        pins=["syssimx[fmu]==0.4.3"],
    ),
    "syssimx-jacobi": Host("syssimx", drivers.syssimx, pins=["syssimx[fmu]==0.4.3"]),
}


def compare(
    system: System,
    hosts: Sequence[str],
    steps: int,
    step: float,
    hear: Callable[[str], None] = lambda line: None,
) -> Iterator[HostVerdict]:
    """Run a system in other hosts, and in our own master in the order of each.

    Args:
        system: the system to run.
        hosts: keys of :data:`HOSTS`.
        steps: number of steps.
        step: communication step [s].
        hear: called with a line before a host is installed.

    Raises:
        InputError: the steps are not possible.

    """
    start = system.start_time or 0.0
    asked = Experiment(start + steps * step, step, "jacobi", start)
    names = _names(system)

    @cache
    def expected(order: str, initial: str, turned: bool) -> tuple[Experiment, np.ndarray]:
        way, table = next(ways(system, Experiment.read_order(order), initial)), Table()
        (way.turn() if turned else way).run(system, asked, table)
        return replace(asked, order=way.order), table.group(*names)[1:]

    def verdict(name: str) -> HostVerdict:
        host = HOSTS[name]
        label = host.label()
        if label is None:
            failure = "not installed: pip install 'auv-fmu[hosts]'"
            return HostVerdict(name, host.package, failure=failure)
        try:
            experiment, table = expected(host.order, host.initial, host.turned)
            rows, seconds, reading = _run(host, label, system, experiment, hear)
        except InputError as error:
            return HostVerdict(name, label, failure=str(error))
        deviations = np.abs(rows - table).max(axis=0)
        worst = int(deviations.argmax())
        return HostVerdict(
            name,
            label,
            float(deviations[worst]),
            names[worst],
            steps / seconds,
            steps / (seconds + reading),
        )

    return map(verdict, hosts)


def _run(
    host: Host, label: str, system: System, experiment: Experiment, hear: Callable[[str], None]
) -> HostRun:
    """Run a system in a host.

    Raises:
        InputError: the host does not run it, or fails.

    """
    fmi = fmi_of(system)
    if fmi not in host.fmi:
        raise InputError(f"does not run FMI {fmi}")
    python = Path(sys.executable)
    if host.pins:
        installing = f"{label} is being installed into its own environment"
        python = python_with(host.pins, lambda: hear(installing))
    with temporary_folder() as folder:
        try:
            process = _process(host, python, system, experiment, folder)
        except subprocess.TimeoutExpired as error:
            raise InputError(f"not finished after {_TIMEOUT} s") from error
        if process.returncode != 0:
            raise InputError(last_line(process.stderr, f"exit status {process.returncode}"))
        with (folder / _ROWS).open(encoding="utf-8", newline="") as lines:
            [seconds, reading], *rows = [[*map(float, line)] for line in csv.reader(lines)]
    if len(rows) != experiment.rows - 1:
        raise InputError(f"{len(rows)} rows instead of {experiment.rows - 1}")
    return HostRun(np.array(rows), seconds, reading)


def _process(
    host: Host, python: Path, system: System, experiment: Experiment, folder: Path
) -> subprocess.CompletedProcess[str]:
    """Run a host in a separate process, which writes its result into a folder."""
    if host.run.__module__ == __name__:
        (folder / _GIVEN).write_bytes(pickle.dumps((system, experiment)))
        return run_module(__name__, host.run.__name__, str(folder), timeout=_TIMEOUT)
    job = json.dumps(_job(system, experiment))
    (folder / drivers.JOB).write_text(job, encoding="utf-8")
    return subprocess.run(
        [python, "-I", drivers.__file__, host.run.__name__, drivers.JOB, _ROWS],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
        cwd=folder,
        env=os.environ | {"TMPDIR": str(folder)},
        timeout=_TIMEOUT,
    )


def _job(system: System, experiment: Experiment) -> dict[str, object]:
    """Return the content of a driver's job file, see :class:`.drivers.Job`.

    Raises:
        InputError: the system has something that drivers do not support.

    """
    check_parameters(system, "its driver")
    outputs = [(component, port) for component, port, _ in real_outputs(system)]
    wires = [
        ((c.source.component, c.source.port), (c.target.component, c.target.port))
        for c in system.connections
    ]
    for feature, words in (
        (system.steps, "longer steps of components"),
        (experiment.start_time, "a start time"),
        (any(c.transformation for c in system.connections), "transformations"),
        ({source for source, _ in wires} - {*outputs}, "connections of other types than Real"),
    ):
        if feature:
            raise InputError(f"can be compared only without {words}")
    return {
        "fmus": {
            name: str(component.fmu.resolve()) for name, component in system.components.items()
        },
        "wires": wires,
        "wanted": outputs,
        "steps": experiment.rows - 1,
        "step": experiment.step,
    }


def folder_of(requirements: Sequence[str]) -> Path:
    """Return the folder of the environment with some packages, which may not exist yet.

    Raises:
        OSError: the cache folder cannot be made.

    """
    key = "\n".join((platform.python_version(), sys.base_prefix, *requirements))
    return category_folder(_CATEGORY) / sha256(key.encode()).hexdigest()[:16]


def is_whole(folder: Path) -> bool:
    """Tell whether an environment is finished."""
    return (folder / _WHOLE).is_file()


def python_with(requirements: Sequence[str], hear: Callable[[], object] = bool) -> Path:
    """Return the Python of the environment with some packages; make the environment if needed.

    Args:
        requirements: requirements of pip.
        hear: called before the environment is made.

    Raises:
        InputError: the environment cannot be made.

    """
    try:
        folder = folder_of(requirements)
        python = Path(get_path("scripts", "venv", {"base": str(folder)}), "python")
        folder.mkdir(0o700, exist_ok=True)
        # The lock is not in the folder itself, which venv clears.
        with hold_lock(folder.parent, wait=True):
            if not is_whole(folder):
                hear()
                _run_command([sys.executable, "-I", "-m", "venv", "--clear", str(folder)])
                _run_command([str(python), "-I", *_PIP, *requirements])
                (folder / _WHOLE).touch()
    except OSError as error:
        raise InputError(f"cannot be installed: {reason(error)}") from error
    return python


def _run_command(command: Sequence[str]) -> None:
    """Run a command and show its last line of output while it works.

    Raises:
        InputError: the command fails.

    """
    lines = ["no reason given"]
    with (
        tqdm(bar_format="{desc}", disable=None, leave=False) as bar,
        subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
        ) as process,
    ):
        assert process.stdout is not None
        try:
            for line in filter(None, map(str.strip, process.stdout)):
                lines.append(line)
                bar.set_description_str(line[:_SHOWN])
        except BaseException:
            process.kill()
            raise
    if process.returncode != 0:
        unreached = any(_UNREACHED in line for line in lines)
        why = "pip cannot reach a package index" if unreached else lines[-1].removeprefix("ERROR: ")
        raise InputError(f"cannot be installed: {why}")


if __name__ == "__main__":
    run: Callable[[System, Experiment, Path], HostRun] = globals()[sys.argv[1]]
    folder = Path(sys.argv[2])
    (folder / _EXPORT).mkdir()
    system, experiment = pickle.loads((folder / _GIVEN).read_bytes())
    try:
        ran = run(system, experiment, folder / _EXPORT)
    except InputError as error:
        sys.exit(str(error))
    write_rows(folder / _ROWS, ran.rows.tolist(), ran.seconds, ran.reading)
