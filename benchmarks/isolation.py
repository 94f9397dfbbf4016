"""Cost of FMUs in separate processes: `python benchmarks/isolation.py`.

Every repetition times the loop of Fig. 4 in one process, then with each FMU in a process of its
own. The set-up of a run is timed by a run of one step, and subtracted. Printed are medians of the
repetitions, the ratio being taken within each repetition.
"""

from __future__ import annotations

import os
from statistics import median

from measuring import options, python, steps_time, timed

from auv_fmu.paper.euler import STEP
from fmus.kinds import PYTHON
from orchestrator.cosim import Experiment, Isolation, System, Table, make_plan, simulate_plan
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.wiring import closed_loop


def start_time(system: System, order: str) -> float:
    """Seconds of a run of one step, with a process for each FMU."""
    plan = make_plan(system, Experiment(STEP, STEP, order), Isolation())
    return timed(lambda: simulate_plan(plan, [Table()]))


def main() -> None:
    """Measure and print."""
    given = options(__doc__).parse_args()
    system = closed_loop(current_fmus(PYTHON))
    print(f"{python()}, {len(os.sched_getaffinity(0))} cores")
    print(f"medians of {given.repetitions} repetitions of {given.steps} steps")
    starts = []
    for order in ("gauss-seidel", "jacobi"):
        rows = []
        for _ in range(given.repetitions):
            rows.append(
                [
                    steps_time(system, given.steps, order, isolation=isolation)
                    for isolation in (None, Isolation())
                ]
            )
            starts.append(start_time(system, order))
        here, there = (1e6 * median(column) / given.steps for column in zip(*rows, strict=True))
        ratio = median(there / here for here, there in rows)
        print(
            f"{order:13} one process {here:6.1f} us a step, a process each {there:6.1f} us, "
            f"ratio {ratio:.2f}"
        )
    print(f"start and end of the processes of a run {median(starts):6.2f} s")


if __name__ == "__main__":
    main()
