"""The bundle in tools of others: `python benchmarks/hosts_of_others [HOST]... [--kind KIND]...`.

Every tool is installed as it is on PyPI today, into a virtual environment of its own, and runs the
four FMUs of Fig. 4 by a driver in `drivers.py`. The positions after every step are held against a
bare master on fmpy that steps the same components in the order and from the beginning of the tool,
and against our own runs. A tool that does not run has the reason in its row, and the others go on.
Exit status 1: one did not run, or is further away than rounding.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from master import FULL, NONE, ZERO, rows

from orchestrator.machine.cache import users_folder
from orchestrator.machine.errors import InputError, did_you_mean, last_line, reason
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.table import Table
from orchestrator.master.plan import make_plan
from orchestrator.master.simulation import simulate_to_end
from orchestrator.runs import bundle
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.structure import System

STEPS, STEP = 5000, 0.02

#: What is compared.
POSITIONS = [("plant", f"eta.{axis}") for axis in "xyz"]

#: Our own orders.
ORDERS = ("gauss-seidel", "jacobi")

#: The kinds of FMUs, and how they are built: kind and version of FMI.
KINDS = {"python": ("python", "2"), "native": ("native", "2"), "fmi3": ("native", "3")}
_FMI2, _ALL = ("python", "native"), tuple(KINDS)

#: Largest deviation from the bare master that is rounding [m]: some tools add up their time.
ROUNDING = 1e-9

#: Columns of the table.
_COLUMNS = (
    "host", "version", "kind", "beginning: order", "steps", "deviation [m]",
    *(f"from `{order}` [m]" for order in ORDERS), "us/step",
)  # fmt: skip

#: How long an installation may take [s], and a run, and each step of it.
_INSTALLING, _STARTING, _STEPPING = 900, 120, 0.1

_DRIVERS = Path(__file__).with_name("drivers.py")

#: What a driver writes before the reason why the tool did not run.
_REASON = "reason: "


class Way(NamedTuple):
    """A way in which a tool runs a system.

    Attributes:
        driver: name of its function in drivers.py.
        beginning, order: of the bare master that does the same.
        label: of the way, where the tool has several.

    """

    driver: str
    beginning: str
    order: str
    label: str = ""


@dataclass(frozen=True)
class Host:
    """A tool of others.

    Attributes:
        requirement: that pip installs.
        kinds: that it is said to run.
        ways: in which it does.

    """

    requirement: str
    kinds: Sequence[str]
    ways: Sequence[Way]

    @property
    def package(self) -> str:
        """Its name on PyPI."""
        return self.requirement.split("[")[0]


HOSTS = {
    "pathsim-fmi": Host(
        "pathsim-fmi",
        _ALL,
        [Way("pathsim_fmi", NONE, "plant,controller,disturbance,planner")],
    ),
    "CoFMuPy": Host("cofmupy", _ALL, [Way("cofmupy", ZERO, "planner,[rest]")]),
    "sofirpy": Host("sofirpy", _FMI2, [Way("sofirpy", ZERO, "jacobi")]),
    "sdf4sim": Host("sdf4sim", _FMI2, [Way("sdf4sim", ZERO, "jacobi")]),
    "fmuloader": Host("fmuloader", _ALL, [Way("fmuloader", FULL, "jacobi")]),
    "gemseo-fmu": Host("gemseo-fmu", _ALL, [Way("gemseo_fmu", ZERO, "planner,[rest]")]),
    "SysSimX": Host(
        "syssimx[fmu]",
        _FMI2,
        [
            Way("syssimx", FULL, "jacobi", "Jacobi"),
            Way(
                "syssimx_gauss_seidel",
                FULL,
                "planner,plant,controller,disturbance",
                "Gauss-Seidel",
            ),
        ],
    ),
}


def interpreter(folder: Path) -> Path:
    """The Python of a virtual environment."""
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def _run(*command: str | Path, timeout: float, folder: Path | None = None) -> str:
    """Run a command, and say what it printed.

    Raises:
        InputError: it failed, or took too long.

    """
    try:
        process = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            cwd=folder,
            env=os.environ | ({"TMPDIR": str(folder)} if folder else {}),
            timeout=timeout,
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"no end after {timeout:g} s") from error
    except OSError as error:
        raise InputError(reason(error)) from error
    if process.returncode < 0:
        raise InputError(f"ended by signal {-process.returncode}")
    if process.returncode != 0:
        told = [line for line in process.stderr.splitlines() if line.startswith(_REASON)]
        text = told[-1] if told else last_line(process.stderr, "it said nothing")
        text = text.removeprefix(_REASON)
        raise InputError(text.replace(f"{folder}/", "") if folder else text)
    return process.stdout


def installed(host: Host, folder: Path) -> str:
    """Bring the environment of a tool up to date, and say which version is in it.

    Raises:
        InputError: it cannot be installed.

    """
    python = interpreter(folder)
    try:
        _run(python, "-I", "-m", "pip", "--version", timeout=_STARTING)
    except InputError:
        _run(sys.executable, "-m", "venv", folder, timeout=_INSTALLING)
    options = ["--quiet", "--disable-pip-version-check", "--upgrade"]
    _run(python, "-I", "-m", "pip", "install", *options, host.requirement, timeout=_INSTALLING)
    code = f"from importlib.metadata import version; print(version('{host.package}'))"
    return _run(python, "-I", "-c", code, timeout=_STARTING).strip()


class Loop:
    """The four FMUs of Fig. 4, of every kind that is asked for, and runs of them without a tool."""

    def __init__(self, folder: Path, steps: int) -> None:
        self.folder, self.steps = folder, steps
        self.system: System = closed_loop(self.built("native"))
        self.wires = [
            ((c.source.component, c.source.port), (c.target.component, c.target.port))
            for c in self.system.connections
        ]

    @cache  # noqa: B019
    def built(self, kind: str) -> Path:
        """The folder of the bundle of a kind."""
        folder = self.folder / kind
        how, fmi = KINDS[kind]
        bundle.build_bundle(folder, kind=how, fmi=fmi)
        return folder

    def fmus(self, kind: str) -> dict[str, str]:
        """The paths of the FMUs, by the names of their components."""
        folder = self.built(kind)
        return {name: str(folder / c.fmu.name) for name, c in self.system.components.items()}

    @cache  # noqa: B019
    def bare(self, beginning: str, order: str) -> np.ndarray:
        """The positions by the bare master: numbers of the kinds are the same."""
        folders = {name: str(c.folder) for name, c in self.system.components.items()}
        return rows(folders, self.wires, POSITIONS, beginning, order, self.steps, STEP)

    @cache  # noqa: B019
    def ours(self, order: str) -> np.ndarray:
        """The positions by our own master."""
        table = Table()
        simulate_to_end(make_plan(self.system, Experiment(self.steps * STEP, STEP, order)), [table])
        return table.group(*(".".join(port) for port in POSITIONS))[1:]

    def driven(self, python: Path, driver: str, kind: str) -> tuple[np.ndarray, float]:
        """The positions by a tool, and the seconds of its steps.

        Raises:
            InputError: the tool does not run.

        """
        job = {
            "fmus": self.fmus(kind),
            "wires": self.wires,
            "wanted": POSITIONS,
            "steps": self.steps,
            "step": STEP,
        }
        with TemporaryDirectory(dir=self.folder) as name:
            folder = Path(name)
            (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
            command = [python, "-I", _DRIVERS, driver, "job.json", "rows.csv"]
            _run(*command, timeout=_STARTING + _STEPPING * self.steps, folder=folder)
            with (folder / "rows.csv").open(encoding="utf-8", newline="") as lines:
                [seconds], *found = [[float(x) for x in line] for line in csv.reader(lines)]
        if len(found) != self.steps:
            raise InputError(f"{len(found)} rows instead of {self.steps}")
        return np.array(found), seconds


def line(*cells: object) -> str:
    """A row of the table."""
    return f"| {' | '.join(str(cell).replace('|', '/') for cell in cells)} |"


def lines(loop: Loop, name: str, kinds: Sequence[str], folder: Path) -> Iterator[tuple[str, bool]]:
    """The rows of a tool, and whether each ran as it should."""
    host, blank = HOSTS[name], ("", "", "")
    known = [kind for kind in kinds if kind in host.kinds]
    if not known:
        return
    try:
        version = installed(host, folder)
    except InputError as error:
        yield line(name, "", "", "", "", f"not installed: {error}", *blank), False
        return
    for way in host.ways:
        label = f"{name}, {way.label}" if way.label else name
        order = f"{way.beginning}: {way.order}"
        for kind in known:
            try:
                found, seconds = loop.driven(interpreter(folder), way.driver, kind)
            except InputError as error:
                yield line(label, version, kind, order, "", f"does not run: {error}", *blank), False
                continue
            others = [loop.bare(way.beginning, way.order), *(loop.ours(name) for name in ORDERS)]
            deviations = [float(np.abs(found - other).max()) for other in others]
            cells = [*(f"{x:.1e}" for x in deviations), f"{1e6 * seconds / len(found):.0f}"]
            yield line(label, version, kind, order, len(found), *cells), deviations[0] < ROUNDING


def main() -> int:
    """Install, run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("host", nargs="*", metavar="HOST", help=f"of {', '.join(HOSTS)}")
    parser.add_argument("--kind", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--steps", type=int, default=STEPS, metavar="N")
    parser.add_argument(
        "--environments",
        type=Path,
        default=users_folder() / "hosts",
        metavar="DIR",
        help="of the virtual environments, one a host; default: %(default)s",
    )
    options = parser.parse_args()
    known = {name.casefold(): name for name in HOSTS}
    for name in options.host:
        if name.casefold() not in known:
            parser.error(f"there is no host {name!r}{did_you_mean(name, HOSTS)}")
    if options.steps < 1:
        parser.error("--steps: give a number of at least 1")
    chosen = [known[name.casefold()] for name in options.host] or list(HOSTS)
    print(f"{platform.python_implementation()} {platform.python_version()}, {platform.machine()}\n")
    print(line(*_COLUMNS))
    print(line(*("---" for _ in _COLUMNS)), flush=True)
    good = True
    with TemporaryDirectory(prefix="auvfmu") as folder:
        loop = Loop(Path(folder), options.steps)
        for name in chosen:
            environment = options.environments.absolute() / HOSTS[name].package
            for text, ran in lines(loop, name, options.kind, environment):
                print(text, flush=True)
                good &= ran
    return 0 if good else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        sys.exit(str(error))
