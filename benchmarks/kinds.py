"""Time of a step of both kinds of FMU in each host: `python benchmarks/kinds.py`.

Every repetition times Fig. 4, one after the other: straight-line Python,
`auv_fmu.loop.closed_loop`; our master on both kinds of FMU, and on native ones in the compiled
loop, with every port recorded; libcosim and ecos on both kinds, in Jacobi order, with and without a
read of every output by their Python interfaces, and our compiled loop in that order. Only the steps
count. The output has medians, with ratios within each repetition, the size of the FMUs, and the
time of an instance after the first.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from ctypes import byref, c_char_p, c_int, c_void_p
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple
from zipfile import ZipFile

import fmpy
from fmpy.fmi2 import FMU2Slave
from measuring import options, python, steps_time, timed

from auv_fmu.loop.closed_loop import closed_loop
from auv_fmu.paper.euler import STEP
from orchestrator.cosim import System
from orchestrator.exchange.hosts import HOSTS, compare
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.wiring import closed_loop as wired

#: Instances that are timed.
INSTANCES = 1000

#: Number of runs for the time of the compiled loop.
MORE_COMPILED = 20

#: Seconds that a number of steps takes.
Engine = Callable[[int], float]


class Pair(NamedTuple):
    """Two engines, to print their ratio."""

    fast: str
    slow: str


STRAIGHT = "straight-line Python loop"
PYTHON, NATIVE = "master, Python kind", "master, native kind"
COMPILED, COMPILED_JACOBI = "compiled loop, native kind", "compiled loop, native kind, Jacobi"

PAIRS = [
    Pair(NATIVE, PYTHON),
    Pair(COMPILED, PYTHON),
    *(Pair(f"{host}, native kind", f"{host}, Python kind") for host in ("libcosim", "ecos")),
    *(Pair(COMPILED_JACOBI, f"{host}, native kind, read") for host in ("libcosim", "ecos")),
]

#: Keys of other hosts by what they are called here.
OTHERS = {"libcosim": "libcosim-ssp", "ecos": "ecos"}


def straight_line(steps: int) -> float:
    """The equations without FMI or master."""
    return timed(lambda: deque(closed_loop(steps), maxlen=0))


def in_our_master(system: System, loop: str, order: str, steps: int) -> float:
    """Steps of a run whose rows are kept in memory, without its set-up."""
    # A set-up takes as long as thousands of compiled steps, and a larger table has other costs.
    times = MORE_COMPILED if loop == "compiled" else 1
    return sum(steps_time(system, steps, order, loop) for _ in range(times)) / times


def in_another(system: System, host: str, is_read: bool, steps: int) -> float:
    """Steps in another host, with or without a read of every output."""
    [verdict] = compare(system, [host], steps, STEP)
    if verdict.failure is not None:
        raise SystemExit(f"{host}: {verdict.failure}")
    return steps / (verdict.rows_per_second if is_read else verdict.steps_per_second)


def engines(python: System, native: System) -> dict[str, Engine]:
    """All measurements that can run here."""
    engines: dict[str, Engine] = {
        STRAIGHT: straight_line,
        PYTHON: partial(in_our_master, python, "python", "gauss-seidel"),
        NATIVE: partial(in_our_master, native, "python", "gauss-seidel"),
        COMPILED: partial(in_our_master, native, "compiled", "gauss-seidel"),
        COMPILED_JACOBI: partial(in_our_master, native, "compiled", "jacobi"),
    }
    for name, host in OTHERS.items():
        if find_spec(HOSTS[host].package) is not None:
            for kind, system in (("Python", python), ("native", native)):
                engines[f"{name}, {kind} kind"] = partial(in_another, system, host, False)
                engines[f"{name}, {kind} kind, read"] = partial(in_another, system, host, True)
    return engines


def instance_time(fmu: Path, folder: Path) -> float:
    """Median seconds of fmi2Instantiate after the first."""
    unpacked = fmpy.extract(fmu, unzipdir=folder)
    description = fmpy.read_model_description(unpacked)
    slave = FMU2Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(unpacked),
    )
    slave.instantiate()  # it knows the callbacks
    make, free = slave.dll["fmi2Instantiate"], slave.dll["fmi2FreeInstance"]
    texts = [b"timed", description.guid.encode(), (folder / "resources").as_uri().encode()]
    name, guid, resources = map(c_char_p, texts)
    callbacks = byref(slave.callbacks)
    make.argtypes, make.restype, free.argtypes, free.restype = None, c_void_p, None, None
    times = []
    for _ in range(INSTANCES):
        start = perf_counter()
        component = make(name, c_int(1), guid, resources, callbacks, c_int(0), c_int(0))
        times.append(perf_counter() - start)
        free(c_void_p(component))
    return median(times)


def libraries_size(fmu: Path) -> float:
    """Size of the libraries in the file of an FMU [kB]."""
    with ZipFile(fmu) as archive:
        entries = [entry for entry in archive.infolist() if entry.filename.startswith("binaries/")]
    return sum(entry.compress_size for entry in entries) / 1000


def main() -> None:
    """Measure and print."""
    given = options(__doc__).parse_args()
    print(python())
    print(f"medians of {given.repetitions} repetitions of {given.steps} steps")
    with TemporaryDirectory(prefix="auvfmu") as temporary:
        folders = {kind: current_fmus(kind) for kind in ("python", "native")}
        runs = engines(*(wired(folder) for folder in folders.values()))
        for run in runs.values():
            run(10)
        times = [
            {name: 1e6 * run(given.steps) / given.steps for name, run in runs.items()}
            for _ in range(given.repetitions)
        ]
        for name in runs:
            print(f"{name:36} {median(row[name] for row in times):8.2f} us a step")
        for fast, slow in PAIRS:
            if slow in runs:
                ratio = median(row[slow] / row[fast] for row in times)
                print(f"{fast} is {ratio:.1f} times faster than {slow}")
        for kind, folder in folders.items():
            for fmu in sorted(folder.glob("*.fmu")):
                seconds = instance_time(fmu, Path(temporary, "unpacked", kind, fmu.stem))
                size = fmu.stat().st_size / 1000
                print(
                    f"{fmu.stem:20} {kind:6} {size:4.0f} kB, {libraries_size(fmu):3.0f} kB of it "
                    f"for the platform, {1e6 * seconds:6.1f} us an instance"
                )


if __name__ == "__main__":
    main()
