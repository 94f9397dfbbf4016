"""Other co-simulation tools as hosts of the bundle, compared with our own Jacobi master.

Every host runs in a separate process, `python -m orchestrator.exchange.hosts HOST FOLDER STEPS
STEP`: some leave threads running or end the process when something is wrong.
"""

from __future__ import annotations

import ctypes
import importlib
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

import fmpy
import numpy as np
from fmpy.ssp.simulation import simulate_ssp

from orchestrator.exchange import c_host
from orchestrator.formats.osp_and_container import write_container, write_osp
from orchestrator.formats.ssp.reader import read_ssp
from orchestrator.formats.ssp.writer import PARAMETER_SET, write_ssp
from orchestrator.machine.children import run_module
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, last_line
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.table import Table
from orchestrator.master.plan import make_plan
from orchestrator.master.simulation import simulate_to_end
from orchestrator.system.structure import System

#: How long a host may take for a run before it is given up [s].
_TIMEOUT = 300


class Ran(NamedTuple):
    """A run in a host.

    Attributes:
        rows: of all Real outputs, one a step.
        seconds: that the steps have taken.
        reading: what it took to read the rows, where the tool does not record them itself.

    """

    rows: np.ndarray
    seconds: float
    reading: float = 0.0


@dataclass(frozen=True)
class Host:
    """A tool that can run the bundle.

    Attributes:
        package: that it comes from.
        run: (system, folder of the export, experiment) -> what came of it.
        bound: largest deviation from our Jacobi master that is expected.
        compared: how the names of the ports begin that are compared.
        why: what makes it deviate, if more than rounding does.

    """

    package: str
    run: Callable[[System, Path, Experiment], Ran]
    bound: float = 1e-9
    compared: tuple[str, ...] = ("",)
    why: str = ""


@dataclass(frozen=True)
class Verdict:
    """What came of a host.

    Attributes:
        host: key of :data:`HOSTS`.
        package: that it comes from, with its version.
        deviation, port: the largest, and where it was.
        steps_per_second: of the tool.
        rows_per_second: with every output read, as this program reads it.
        failure: why it did not run; None: it did.
        agrees: whether the deviation is within the host's bound.

    """

    host: str
    package: str
    deviation: float = float("nan")
    port: str = ""
    steps_per_second: float = float("nan")
    rows_per_second: float = float("nan")
    failure: str | None = None
    agrees: bool = False


def _real_outputs(system: System) -> list[tuple[str, str, int]]:
    """Component, port and value reference of every Real output."""
    return [
        (component.name, variable.name, variable.valueReference)
        for component in system.components.values()
        for variable in component.having("output")
        if variable.type == "Real"
    ]


def _names(system: System, between: str = ".") -> list[str]:
    """Names of all Real outputs, as tools write them."""
    return [f"{component}{between}{port}" for component, port, _ in _real_outputs(system)]


def _stepped(
    step: Callable[[], object], read: Callable[[], list[float]], experiment: Experiment
) -> Ran:
    """Step a tool that is read after each step."""
    rows, seconds, reading = [], 0.0, 0.0
    for _ in range(experiment.rows - 1):
        start = perf_counter()
        step()
        stepped = perf_counter()
        rows.append(read())
        seconds += stepped - start
        reading += perf_counter() - stepped
    return Ran(np.array(rows), seconds, reading)


def _libcosim(system: System, experiment: Experiment, opener: str, **path: str) -> Ran:
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # noqa: PLC0415
    from libcosimpy.CosimObserver import CosimObserver  # noqa: PLC0415

    log_output_level(CosimLogLevel.ERROR)
    execution = getattr(CosimExecution, opener)(**path)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    references: dict[str, list[int]] = {}
    for component, _, reference in _real_outputs(system):
        references.setdefault(component, []).append(reference)
    index = {name: execution.slave_index_from_instance_name(name) for name in references}

    def one() -> None:
        if not execution.step():
            raise InputError("libcosim ended the run")

    def read() -> list[float]:
        return [
            value
            for name, wanted in references.items()
            for value in observer.last_real_values(index[name], wanted)
        ]

    return _stepped(one, read, experiment)


def _libcosim_ssp(system: System, folder: Path, experiment: Experiment) -> Ran:
    [path] = write_ssp(system, folder)
    return _libcosim(system, experiment, "from_ssp_file", ssp_path=str(path))


def _libcosim_osp(system: System, folder: Path, experiment: Experiment) -> Ran:
    write_osp(system, folder)
    return _libcosim(system, experiment, "from_osp_config_file", osp_path=str(folder))


def _ecos(system: System, folder: Path, experiment: Experiment) -> Ran:
    if experiment.start_time != 0.0:
        # It tells the FMUs a start time, and then steps them from 0 s.
        raise InputError(f"ecos runs from 0 s only, not from {experiment.start_time:g} s")
    # ecospy needs libtbb, which the wheel tbb puts where the loader does not look.
    for library in Path(sys.prefix, "lib").glob("libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    ecospy = importlib.import_module("ecospy")
    [path] = write_ssp(system, folder)
    names = _names(system, "::")
    with ecospy.EcosSimulation(step_size=experiment.step, ssp_path=str(path)) as simulation:
        simulation.init(**({"parameter_set": PARAMETER_SET} if system.parameters else {}))
        return _stepped(simulation.step, lambda: [*map(simulation.get_real, names)], experiment)


def _fmpy_ssp(system: System, folder: Path, experiment: Experiment) -> Ran:
    # fmpy.ssp ignores parameter bindings and Boolean connectors without a start value.
    [path] = write_ssp(replace(system, parameters={}), folder)
    start_time, step = experiment.start_time, experiment.step
    start = perf_counter()
    # It accumulates its time, so the last step may be there or not: ask for half a step more.
    table = simulate_ssp(str(path), start_time, experiment.stop_time + 0.5 * step, step)
    seconds = perf_counter() - start
    # Its row at a time has the outputs of the step that begins there.
    rows = np.column_stack([table[name] for name in _names(system)])
    return Ran(rows[: experiment.rows - 1], seconds)


def _container(system: System, folder: Path, experiment: Experiment) -> Ran:
    [path] = write_container(system, folder)
    start = perf_counter()
    table = fmpy.simulate_fmu(
        str(path),
        start_time=experiment.start_time,
        stop_time=experiment.stop_time,
        step_size=experiment.step,
        output_interval=experiment.step,
    )
    seconds = perf_counter() - start
    return Ran(np.column_stack([table[name] for name in _names(system)])[1:], seconds)


def _c_program(system: System, folder: Path, experiment: Experiment) -> Ran:
    program = c_host.compile_host(folder, system, experiment)
    rows, seconds = c_host.run_host([program], folder, experiment.rows - 1, _names(system))
    return Ran(rows[1:], seconds)


#: By the names that the command line has for them.
HOSTS: dict[str, Host] = {
    "libcosim-ssp": Host("libcosimpy", _libcosim_ssp),
    "libcosim-osp": Host("libcosimpy", _libcosim_osp),
    "ecos": Host("ecospy", _ecos),
    "container": Host("fmu_manipulation_toolbox", _container),
    "fmpy-ssp": Host(
        "fmpy",
        _fmpy_ssp,
        bound=0.03,
        compared=("plant.eta.x", "plant.eta.y", "plant.eta.z"),
        why="exchanges no initial values and accumulates its time",
    ),
    "c-program": Host("auv_fmu", _c_program),
}


def compare(system: System, hosts: Sequence[str], steps: int, step: float) -> list[Verdict]:
    """Run a system in other hosts and in our own master in Jacobi order.

    Args:
        system: to run.
        hosts: keys of :data:`HOSTS`.
        steps: how many.
        step: communication step [s].

    """
    expected = Table()
    simulate_to_end(make_plan(system, _experiment(system, steps, step)), [expected])
    names = _names(system)
    table = expected.group(*names)[1:]
    return [_verdict(system, host, steps, step, names, table) for host in hosts]


def _experiment(system: System, steps: int, step: float) -> Experiment:
    start = system.start_time or 0.0
    return Experiment(start + steps * step, step, "jacobi", start)


def _verdict(
    system: System, host: str, steps: int, step: float, names: list[str], table: np.ndarray
) -> Verdict:
    package = HOSTS[host].package
    try:
        labelled = f"{package} {version(package)}"
    except PackageNotFoundError:
        return Verdict(host, package, failure="not installed: pip install 'auv-fmu[hosts]'")
    with TemporaryDirectory(dir=process_folder()) as folder:
        write_ssp(replace(system, name="given", step=step), Path(folder))
        arguments = [host, folder, str(steps), str(step)]
        try:
            process = run_module("orchestrator.exchange.hosts", *arguments, timeout=_TIMEOUT)
        except subprocess.TimeoutExpired:
            return Verdict(host, labelled, failure=f"no end after {_TIMEOUT} s")
        if process.returncode != 0:
            reason = last_line(process.stderr, f"exit status {process.returncode}")
            return Verdict(host, labelled, failure=reason)
        with np.load(Path(folder, "rows.npz")) as content:
            ran = Ran(content["rows"], float(content["seconds"]), float(content["reading"]))
    if ran.rows.shape != table.shape:
        return Verdict(host, labelled, failure=f"{len(ran.rows)} rows instead of {len(table)}")
    deviation = np.abs(ran.rows - table).max(axis=0)
    compared = [i for i, name in enumerate(names) if name.startswith(HOSTS[host].compared)]
    worst_port = max(compared, key=lambda i: float(deviation[i]))
    worst = float(deviation[worst_port])
    return Verdict(
        host,
        labelled,
        worst,
        names[worst_port],
        steps / ran.seconds,
        steps / (ran.seconds + ran.reading),
        agrees=worst <= HOSTS[host].bound,
    )


def _child(host: str, folder: Path, steps: int, step: float) -> None:
    system = read_ssp(folder / "given.ssp")
    export = folder / "export"
    export.mkdir()
    experiment = _experiment(system, steps, step)
    ran = HOSTS[host].run(replace(system, name="auv"), export, experiment)
    np.savez(folder / "rows.npz", **ran._asdict())


if __name__ == "__main__":
    _child(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
