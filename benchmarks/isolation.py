"""What FMUs in processes of their own cost: `python benchmarks/isolation.py`.

Every repetition times the loop of Fig. 4 in one process, then with each FMU in a process of its
own. The set-up of a run is timed by a run of one step, and subtracted. Printed are medians of the
repetitions, the ratio being taken within each repetition.
"""

from __future__ import annotations

import argparse
import os
import platform
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from auv_fmu.euler import STEP
from orchestrator.master.experiment import ORDERS, Experiment
from orchestrator.master.fmi.isolated import Isolation
from orchestrator.master.observers.table import Table
from orchestrator.master.plan import planned
from orchestrator.master.simulation import simulate
from orchestrator.runs import bundle
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.structure import System


def run_time(system: System, steps: int, order: str, isolation: Isolation | None) -> float:
    """Wall-clock seconds of a run whose rows are kept in memory."""
    start = perf_counter()
    simulate(planned(system, Experiment(steps * STEP, STEP, order)), [Table()], isolation)
    return perf_counter() - start


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--repetitions", type=int, default=9)
    options = parser.parse_args()
    with TemporaryDirectory(prefix="auvfmu") as folder:
        bundle.build(Path(folder))
        system = closed_loop(Path(folder))
        cores = len(os.sched_getaffinity(0))
        print(
            f"{platform.python_implementation()} {platform.python_version()}, "
            f"{platform.machine()}, {cores} cores"
        )
        print(f"medians of {options.repetitions} repetitions of {options.steps} steps")
        starts = []
        for order in ORDERS:
            rows = []
            for _ in range(options.repetitions):
                times = []
                for isolation in (None, Isolation()):
                    start = run_time(system, 1, order, isolation)
                    times.append(run_time(system, options.steps, order, isolation) - start)
                rows.append(times)
                starts.append(start)
            here, there = (
                1e6 * median(column) / options.steps for column in zip(*rows, strict=True)
            )
            ratio = median(there / here for here, there in rows)
            print(
                f"{order:13} one process {here:6.1f} us a step, a process each {there:6.1f} us, "
                f"ratio {ratio:.2f}"
            )
        print(f"start and end of the processes of a run {median(starts):6.2f} s")


if __name__ == "__main__":
    main()
