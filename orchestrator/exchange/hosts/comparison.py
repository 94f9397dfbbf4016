"""Hosts of others, each compared with our own master in the order of the host."""

from __future__ import annotations

import csv
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cosim import Experiment, System, Table
from orchestrator.exchange.hosts import drivers, here
from orchestrator.exchange.hosts.environments import python_with
from orchestrator.exchange.verify import ways
from orchestrator.machine.children import run_module
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError, last_line

#: Largest deviation that is rounding: many tools add up their time.
BOUND = 1e-9

#: How long a host may take for a run before it is given up [s].
_TIMEOUT = 600

#: The versions of FMI that hosts run.
_FMI_2, _BOTH = ("2.0",), ("2.0", "3.0")


@dataclass(frozen=True)
class Host:
    """A tool that can run the bundle.

    Attributes:
        package: that it comes from.
        run: the function that runs it, of :mod:`.here` or of :mod:`.drivers`.
        fmi: versions of FMI that it runs.
        order: in which it steps the components, as `auv-fmu verify` has it.
        initial: what it exchanges before the first step.
        turned: whether outputs are read after values were passed on.
        pins: what is installed into an environment of its own, as pip has it; none: it is used as
            it is in the present one.

    """

    package: str
    run: Callable[..., Any]
    fmi: Sequence[str] = _FMI_2
    order: str = "jacobi"
    initial: str = "full"
    turned: bool = False
    pins: Sequence[str] = ()

    def label(self) -> str | None:
        """The package with its version; None: it is not installed where it should be."""
        for pin in self.pins:
            return f"{self.package} {pin.partition('==')[2]}"
        try:
            return f"{self.package} {version(self.package)}"
        except PackageNotFoundError:
            return None


@dataclass(frozen=True)
class HostVerdict:
    """What came of a host.

    Attributes:
        host: key of :data:`HOSTS`.
        package: that it comes from, with its version.
        deviation, port: the largest, and where it was.
        steps_per_second: of the tool.
        rows_per_second: with every output read, as this program reads it.
        failure: why it did not run; None: it did.

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
        """Whether it has run, and deviates by no more than rounding."""
        return self.deviation <= BOUND


_REST = "planner,plant+controller+disturbance"

#: By the names that the command line has for them; the ones with pins come last.
HOSTS: dict[str, Host] = {
    "libcosim-ssp": Host("libcosimpy", here.libcosim_ssp),
    "libcosim-osp": Host("libcosimpy", here.libcosim_osp),
    "ecos": Host("ecospy", here.ecos, _BOTH, turned=True),
    "fmpy": Host("fmpy", drivers.fmpy_slaves, _BOTH),
    "fmpy-ssp": Host("fmpy", here.fmpy_ssp, initial="zero"),
    "cofmupy": Host("cofmupy", drivers.cofmupy, _BOTH, _REST, "zero", pins=["cofmupy==1.0.0"]),
    "fmuloader": Host("fmuloader", drivers.fmuloader, _BOTH, pins=["fmuloader==0.1.2rc0"]),
    "gemseo-fmu": Host(
        "gemseo-fmu", drivers.gemseo_fmu, _BOTH, _REST, "zero", pins=["gemseo-fmu==3.1.1"]
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
    told: Callable[[str], None] = lambda text: None,
) -> Iterator[HostVerdict]:
    """Run a system in other hosts, and in our own master in the order of each.

    Args:
        system: to run.
        hosts: keys of :data:`HOSTS`.
        steps: how many.
        step: communication step [s].
        told: hears what takes its time before a run.

    Raises:
        InputError: there are no such steps.

    """
    start = system.start_time or 0.0
    asked = Experiment(start + steps * step, step, "jacobi", start)
    names = [f"{component}.{port}" for component, port, _ in here.real_outputs(system)]

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
            rows, seconds, reading = _ran(host, label, system, experiment, told)
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


def _ran(
    host: Host, label: str, system: System, experiment: Experiment, told: Callable[[str], None]
) -> tuple[np.ndarray, float, float]:
    """All Real outputs after every step, the seconds of the steps, and of reading them.

    Raises:
        InputError: it does not run.

    """
    fmi = here.fmi_of(system)
    if fmi not in host.fmi:
        raise InputError(f"does not run FMI {fmi}")
    python = Path(sys.executable)
    if host.pins:
        installing = f"{label} is being installed into its own environment"
        python = python_with(host.pins, lambda: told(installing))
    with temporary_folder() as folder:
        try:
            process = _process(host, python, system, experiment, folder)
        except subprocess.TimeoutExpired as error:
            raise InputError(f"not finished after {_TIMEOUT} s") from error
        if process.returncode != 0:
            raise InputError(last_line(process.stderr, f"exit status {process.returncode}"))
        with (folder / here.ROWS).open(encoding="utf-8", newline="") as lines:
            [seconds, reading], *rows = [[*map(float, line)] for line in csv.reader(lines)]
    if len(rows) != experiment.rows - 1:
        raise InputError(f"{len(rows)} rows instead of {experiment.rows - 1}")
    return np.array(rows), seconds, reading


def _process(
    host: Host, python: Path, system: System, experiment: Experiment, folder: Path
) -> subprocess.CompletedProcess[str]:
    """Run a host in a process of its own."""
    if host.run.__module__ == here.__name__:
        (folder / here.GIVEN).write_bytes(pickle.dumps((system, experiment)))
        return run_module(here.__name__, host.run.__name__, str(folder), timeout=_TIMEOUT)
    job = json.dumps(_job(system, experiment))
    (folder / drivers.JOB).write_text(job, encoding="utf-8")
    return subprocess.run(
        [python, "-I", drivers.__file__, host.run.__name__, drivers.JOB, here.ROWS],
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
    """What a driver is given, see :class:`.drivers.Job`.

    Raises:
        InputError: the system has what drivers do not pass on.

    """
    here.check_parameters(system, "its driver")
    outputs = [(component, port) for component, port, _ in here.real_outputs(system)]
    wires = [
        ((c.source.component, c.source.port), (c.target.component, c.target.port))
        for c in system.connections
    ]
    for found, what in (
        (system.steps, "longer steps of components"),
        (experiment.start_time, "a start time"),
        (any(c.transformation for c in system.connections), "transformations"),
        ({source for source, _ in wires} - {*outputs}, "connections of other types than Real"),
    ):
        if found:
            raise InputError(f"can be compared only without {what}")
    return {
        "fmus": {
            name: str(component.fmu.resolve()) for name, component in system.components.items()
        },
        "wires": wires,
        "wanted": outputs,
        "steps": experiment.rows - 1,
        "step": experiment.step,
    }
