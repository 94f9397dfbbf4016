"""What the FMU loop costs beside a straight line of Python: `python benchmarks/closed_loop.py`.

Every repetition times, one after the other in this process:

- the straight line `auv_fmu.closed_loop`, the same equations without FMI or master;
- the loop of FMUs, with all checks of the components on;
- the same FMUs with an empty do_step, set on their loaded classes;
- the master alone, with every FMI call replaced by nothing;
- the loop of FMUs compiled, and the compiled loop alone.

The set-up of a run (unzip, load, initialise) is timed by a run of one step and subtracted.
Printed are medians of the repetitions, ratios being taken within each repetition.
"""

from __future__ import annotations

import ctypes
import sys
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from statistics import median
from unittest.mock import patch

from measuring import options, python, steps_time, timed

from auv_fmu.closed_loop import closed_loop
from auv_fmu.euler import STEP
from fmus.kinds import PYTHON
from orchestrator.master.experiment import Experiment
from orchestrator.master.fmi.instance import Instance
from orchestrator.master.fmi.slaves import FMU2OfOthers
from orchestrator.master.loop import Stepping, choose_loop
from orchestrator.master.schedule import Member
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.wiring import closed_loop as wired
from orchestrator.system.structure import System

#: So many times the steps, so that what they cost is not lost in the set-up that is subtracted.
_TIMES = 30


def slave_classes() -> list[type]:
    """The classes of the FMUs that are loaded into this process."""
    return [
        getattr(module, name.rsplit("_", 1)[0])
        for name, module in list(sys.modules.items())
        if hasattr(module, name.rsplit("_", 1)[0]) and hasattr(module, "settle")
    ]


def with_empty_steps(system: System, steps: int) -> float:
    """Seconds of the steps when the components compute nothing."""
    with ExitStack() as stack:
        for slave in slave_classes():
            stack.enter_context(patch.object(slave, "do_step", lambda *_: True))
        return steps_time(system, steps)


def master_alone(system: System, steps: int) -> float:
    """Seconds of the steps when no FMI function is called in them."""

    def nothing(*_: object) -> int:
        return 0

    def calls(instance: Instance) -> Member:
        return Member([nothing], nothing, [nothing], instance)

    with patch("orchestrator.master.schedule.member", calls):
        return steps_time(system, steps)


def compiled_alone(system: System, steps: int, stepping: Stepping) -> float:
    """Seconds of the steps of the compiled loop when every function it calls does nothing."""
    # One, which is FMI's warning, is all that this one has to say.
    nothing = ctypes.cast(ctypes.pythonapi.Py_IsInitialized, ctypes.c_void_p).value
    with patch.object(FMU2OfOthers, "address", lambda *_: nothing):
        return steps_time(system, _TIMES * steps, stepping=stepping) / _TIMES


def main() -> None:
    """Measure and print."""
    given = options(__doc__).parse_args()
    rows = []
    system = wired(current_fmus(PYTHON))
    steps_time(system, 10)
    fast = choose_loop("compiled", Experiment(STEP, STEP))
    for _ in range(given.repetitions):
        straight = timed(lambda: deque(closed_loop(given.steps), maxlen=0))
        fmus = steps_time(system, given.steps)
        empty = with_empty_steps(system, given.steps)
        master = master_alone(system, given.steps)
        compiled = steps_time(system, given.steps, stepping=fast)
        stepper = compiled_alone(system, given.steps, fast)
        rows.append((straight, fmus, empty, master, compiled, stepper))

    def per_step(index: int) -> float:
        return 1e6 * median(row[index] for row in rows) / given.steps

    def share(part: Callable[[float, float, float], float]) -> float:
        return 100 * median(part(*row[1:4]) / row[1] for row in rows)

    print(python())
    print(f"medians of {given.repetitions} repetitions of {given.steps} steps")
    print(f"straight-line Python loop         {per_step(0):7.1f} us a step")
    print(f"FMU loop                          {per_step(1):7.1f} us a step")
    print(f"FMU loop, empty do_step           {per_step(2):7.1f} us a step")
    print(f"FMU loop, compiled                {per_step(4):7.1f} us a step")
    print(f"compiled loop alone               {per_step(5):7.2f} us a step")
    print(f"FMU loop / straight-line loop     {median(b / a for a, b, *_ in rows):7.2f}")
    print(f"FMU loop / FMUs with empty do_step{median(b / c for _, b, c, *_ in rows):7.2f}")
    print(f"FMU loop / compiled               {median(row[1] / row[4] for row in rows):7.2f}")
    print(f"share of the master               {share(lambda b, c, d: d):7.0f} %")
    print(f"share of wrapper and FMI calls    {share(lambda b, c, d: c - d):7.0f} %")
    print(f"share of the components' steps    {share(lambda b, c, d: b - c):7.0f} %")


if __name__ == "__main__":
    main()
