"""What several of these scripts measure and print alike."""

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
    """The options of a script that repeats runs of some steps, from its docstring."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--repetitions", type=int, default=9)
    return parser


def python() -> str:
    """What runs here, and on what."""
    return f"{platform.python_implementation()} {platform.python_version()}, {platform.machine()}"


def timed(function: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    """Seconds of one call: of the wall clock, or of another."""
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
    """What a script finds in a process of its own, which may not end well.

    Args:
        script: that tells it, by :func:`tell`, where :data:`ONE` is its first argument.
        arguments: that follow.
        limit: for all of it [s].

    Raises:
        RuntimeError: it found nothing; the text says why.

    """
    command = [sys.executable, script, ONE, *map(str, arguments)]
    try:
        process = subprocess.run(command, capture_output=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"not at its end after {limit:g} s") from None
    for line in process.stdout.decode(errors="replace").splitlines():
        if line.startswith(ONE):
            return json.loads(line.removeprefix(ONE))
    said = process.stderr.decode(errors="replace").strip().splitlines()
    why = said[-1][:80] if said else "without a word"
    raise RuntimeError(f"failed ({process.returncode}): {why}")


def tell(found: object) -> None:
    """Tell the process that waits what was found, past whatever FMUs and hosts print."""
    print(f"\n{ONE}{json.dumps(found)}", flush=True)


def ecos() -> Any:
    """The package of ecos, whose libtbb the wheel tbb puts where the loader does not look."""
    for library in Path(sys.prefix, "lib").glob("libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import ecospy  # noqa: PLC0415

    return ecospy


def libcosim() -> Any:
    """The executions of libcosim, which says no more than what goes wrong."""
    from libcosimpy.CosimExecution import CosimExecution  # noqa: PLC0415
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level  # noqa: PLC0415

    log_output_level(CosimLogLevel.ERROR)
    return CosimExecution
