"""Measurements and options that several of these scripts share."""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

from auv_fmu.paper.euler import STEP
from orchestrator.cosim import (
    Experiment,
    Isolation,
    Order,
    System,
    Table,
    make_plan,
    simulate_plan,
)

#: The first argument of a script where it makes one run, in a process of its own.
ONE = "--one"


def options(text: str) -> argparse.ArgumentParser:
    """Make the parser of a script that repeats runs, with its docstring."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--repetitions", type=int, default=9)
    return parser


def python() -> str:
    """Version of Python, and the type of machine."""
    return f"{platform.python_implementation()} {platform.python_version()}, {platform.machine()}"


def timed(function: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    """Seconds of one call, by the wall clock or another one."""
    start = clock()
    function()
    return clock() - start


def steps_time(
    system: System,
    steps: int,
    order: Order | None = None,
    loop: str = "python",
    isolation: Isolation | None = None,
) -> float:
    """Seconds of the steps of a run whose rows are kept in memory, without its set-up."""

    def run(n: int) -> None:
        plan = make_plan(system, Experiment(n * STEP, STEP, order), isolation, loop)
        simulate_plan(plan, [Table()])

    return timed(lambda: run(steps)) - timed(lambda: run(1))


def resident() -> float:
    """Resident memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def found_apart(script: str, *arguments: object, limit: float) -> Any:
    """Run a script in a separate process, which may crash, and return its result.

    Args:
        script: which prints its result by :func:`tell` if its first argument is :data:`ONE`.
        arguments: further arguments.
        limit: time limit [s].

    Raises:
        RuntimeError: there is no result; the text has the reason.

    """
    command = [sys.executable, script, ONE, *map(str, arguments)]
    try:
        process = subprocess.run(command, capture_output=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"not at its end after {limit:g} s") from None
    for line in process.stdout.decode(errors="replace").splitlines():
        if line.startswith(ONE):
            return json.loads(line.removeprefix(ONE))
    complaints = process.stderr.decode(errors="replace").strip().splitlines()
    why = complaints[-1][:80] if complaints else "without a word"
    raise RuntimeError(f"failed ({process.returncode}): {why}")


def tell(found: object) -> None:
    """Print a result for the waiting process, distinct from the output of FMUs and hosts."""
    print(f"\n{ONE}{json.dumps(found)}", flush=True)


def ecos() -> Any:
    """Import ecos, with libtbb, which the wheel tbb installs outside the loader's path."""
    for library in Path(sys.prefix, "lib").glob("libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import ecospy  # noqa: PLC0415

    return ecospy


def libcosim() -> Any:
    """Import libcosim's CosimExecution, and log only errors."""
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # noqa: PLC0415

    log_output_level(CosimLogLevel.ERROR)
    return CosimExecution
