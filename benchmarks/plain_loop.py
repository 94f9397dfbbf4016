"""Time of a step of Fig. 4 in C written by hand: `python benchmarks/plain_loop.py`.

`plain_loop.c` is only the loop, the fastest program for it. It is built in several ways and
compared with the batch engine, which also computes all indices. All make the same run without
noise, in turns. Each row has the shortest processor time, less the time of a run of one step, and
its ratio to the fastest build.

By default zig compiles for the processor that it runs on.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

from measuring import options, python, timed

from auv_fmu.paper.euler import STEP
from orchestrator.runs.preparation import load
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.columns import Point
from orchestrator.studies.engine import outcomes_of

SOURCE = Path(__file__).with_suffix(".c")

_GCC = ("gcc", "-std=c99", "-ffp-contract=off")
_ZIG = (sys.executable, "-m", "ziglang", "cc", "-std=c99", "-ffp-contract=off")

#: Ways to build it.
_BUILDS = {
    "gcc -O2": (*_GCC, "-O2"),
    "gcc -O3": (*_GCC, "-O3", "-fno-math-errno"),
    "gcc -O3 -march=native": (*_GCC, "-O3", "-fno-math-errno", "-march=native"),
    "zig -O3 -mcpu=baseline": (*_ZIG, "-O3", "-fno-math-errno", "-mcpu=baseline"),
    "zig -O3": (*_ZIG, "-O3", "-fno-math-errno"),
}


class State(ctypes.Structure):
    """Final values of the program, in order."""

    _fields_ = (
        ("position", 3 * ctypes.c_double),
        ("quaternion", 4 * ctypes.c_double),
        ("nu", 6 * ctypes.c_double),
        ("y_hat", 3 * ctypes.c_double),
        ("dy_hat_o", 3 * ctypes.c_double),
        ("theta_hat", 4 * ctypes.c_double),
        ("position_d", 3 * ctypes.c_double),
        ("theta_d", ctypes.c_double),
        ("psi_d", ctypes.c_double),
        ("nu_d", 5 * ctypes.c_double),
        ("square", 3 * ctypes.c_double),
        ("error", ctypes.c_double),
    )


def built(command: tuple[str, ...], path: Path) -> ctypes.CDLL:
    """Library that a command compiles from the program."""
    subprocess.run([*command, "-shared", "-fPIC", SOURCE, "-o", path, "-lm"], check=True)
    library = ctypes.CDLL(str(path))
    library.run.argtypes = (ctypes.c_long, ctypes.POINTER(State))
    library.run.restype = None
    return library


def run(library: ctypes.CDLL, steps: int) -> State:
    """Make a run."""
    state = State()
    library.run(steps, state)
    return state


def builds(folder: Path) -> Iterator[tuple[str, Callable[[int], object]]]:
    """Functions that make a run of some steps, for each build with a compiler."""
    for name, command in _BUILDS.items():
        if find_spec("ziglang") if "ziglang" in command else shutil.which(command[0]):
            yield name, partial(run, built(command, folder / f"{name.replace(' ', '')}.so"))


def batch() -> Callable[[int], object]:
    """Function that makes a run of some steps by the batch engine."""
    engine = BatchEngine({"fig4": load("fig4")})

    def make(steps: int) -> None:
        point = Point(0, "fig4", {"plant.noise.std": 0.0}, steps * STEP, STEP)
        deque(outcomes_of(engine, [point]), maxlen=0)

    return make


def step_times(
    rows: dict[str, Callable[[int], object]], steps: int, repetitions: int
) -> dict[str, float]:
    """Microseconds of a step of each, in the shortest runs, without their start."""
    once, whole = dict.fromkeys(rows, inf), dict.fromkeys(rows, inf)
    for _ in range(repetitions):
        for name, make in rows.items():
            make(1)  # warm the caches of the processor
            once[name] = min(once[name], timed(partial(make, 1), process_time))
            whole[name] = min(whole[name], timed(partial(make, steps + 1), process_time))
    return {name: 1e6 * (whole[name] - once[name]) / steps for name in rows}


def main() -> None:
    """Measure and print."""
    parser = options(__doc__)
    parser.set_defaults(repetitions=99)
    given = parser.parse_args()
    with TemporaryDirectory(prefix="auvfmu") as folder:
        plain = dict(builds(Path(folder)))
        if not plain:
            raise SystemExit("plain_loop.py needs gcc, or the package ziglang")
        rows = {**plain, "batch engine": batch()}
        times = step_times(rows, given.steps, given.repetitions)
    fastest = min(plain, key=lambda name: times[name])
    print(f"{python()}, {given.repetitions} repetitions of {given.steps} steps, processor's time")
    for name, time in times.items():
        ratio = time / times[fastest]
        print(f"{name:23} {time:6.3f} us a step, {ratio:5.2f} times that of {fastest}")


if __name__ == "__main__":
    main()
