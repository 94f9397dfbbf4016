"""Time of a step of the FMU loop and of straight-line Python: `python benchmarks/closed_loop.py`.

Every repetition times, one after the other in this process:

- straight-line Python, `auv_fmu.loop.closed_loop`, the same equations without FMI or master;
- the loop of FMUs, with all checks of the components;
- the same FMUs with components that compute nothing, patched in their loaded classes;
- only the master, with every FMI call replaced by nothing;
- the compiled loop of FMUs, and the compiled loop without FMUs.

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
from typing import Any
from unittest.mock import patch

from measuring import options, python, steps_time, timed

from auv_fmu.loop.closed_loop import closed_loop
from fmus.kinds import PYTHON
from fmus.python.component import Component
from fmus.python.state import STEPPING
from orchestrator.cosim import System
from orchestrator.cosim.fmi.instance import Instance
from orchestrator.cosim.fmi.loaded import FMU2OfOthers
from orchestrator.cosim.stages import Member
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.wiring import closed_loop as wired

#: So many times the steps, so that what they cost is not lost in the set-up that is subtracted.
_TIMES = 30

Calls = list[Callable[[], int]]


def slave_classes() -> list[type[Component]]:
    """Slave classes of the FMUs in this process, where `settle` has stored them."""
    return [vars(module)[""] for module in list(sys.modules.values()) if "" in vars(module)]


def without_equations(system: System, steps: int) -> float:
    """Seconds of the steps when the components compute nothing."""

    def idle(evaluate: Callable[..., Any]) -> Callable[..., Any]:
        def evaluated(self: Component, state: Any, derived: Any, *rest: Any) -> Any:
            if self._mode != STEPPING:
                return evaluate(self, state, derived, *rest)
            return derived, self._store.outputs

        return evaluated

    with ExitStack() as stack:
        slaves = slave_classes()
        assert len(slaves) == len(system.components)
        for slave in slaves:
            stack.enter_context(patch.object(slave, "evaluate", idle(slave.evaluate)))
            stack.enter_context(
                patch.object(slave, "advance", lambda self, state, derived, *_: (state, derived))
            )
        return steps_time(system, steps)


def master_alone(system: System, steps: int) -> float:
    """Seconds of the steps when no FMI function is called in them."""

    def nothing(*_: object) -> int:
        return 0

    def idle(set_inputs: Calls, do_step: Any, get_outputs: Calls, instance: Instance) -> Member:
        return Member(
            [nothing] * len(set_inputs), do_step and nothing, [nothing] * len(get_outputs), instance
        )

    with patch("orchestrator.cosim.stages.Member", idle):
        return steps_time(system, steps)


def compiled_alone(system: System, steps: int, loop: str) -> float:
    """Seconds of the steps of the compiled loop when every function it calls does nothing."""
    # This function returns 1, which is FMI's warning.
    nothing = ctypes.cast(ctypes.pythonapi.Py_IsInitialized, ctypes.c_void_p).value
    with patch.object(FMU2OfOthers, "address", lambda *_: nothing):
        return steps_time(system, _TIMES * steps, loop=loop) / _TIMES


def main() -> None:
    """Measure and print."""
    given = options(__doc__).parse_args()
    rows = []
    system = wired(current_fmus(PYTHON))
    steps_time(system, 10)
    for _ in range(given.repetitions):
        straight = timed(lambda: deque(closed_loop(given.steps), maxlen=0))
        fmus = steps_time(system, given.steps)
        idle = without_equations(system, given.steps)
        master = master_alone(system, given.steps)
        compiled = steps_time(system, given.steps, loop="compiled")
        stepper = compiled_alone(system, given.steps, "compiled")
        rows.append((straight, fmus, idle, master, compiled, stepper))

    def per_step(index: int) -> float:
        return 1e6 * median(row[index] for row in rows) / given.steps

    def share(part: Callable[[float, float, float], float]) -> float:
        return 100 * median(part(*row[1:4]) / row[1] for row in rows)

    print(python())
    print(f"medians of {given.repetitions} repetitions of {given.steps} steps")
    print(f"straight-line Python loop         {per_step(0):7.1f} us a step")
    print(f"FMU loop                          {per_step(1):7.1f} us a step")
    print(f"FMU loop without equations        {per_step(2):7.1f} us a step")
    print(f"FMU loop, compiled                {per_step(4):7.1f} us a step")
    print(f"compiled loop alone               {per_step(5):7.2f} us a step")
    print(f"FMU loop / straight-line loop     {median(b / a for a, b, *_ in rows):7.2f}")
    print(f"FMU loop / without equations      {median(b / c for _, b, c, *_ in rows):7.2f}")
    print(f"FMU loop / compiled               {median(row[1] / row[4] for row in rows):7.2f}")
    print(f"share of the master               {share(lambda b, c, d: d):7.0f} %")
    print(f"share of wrapper and FMI calls    {share(lambda b, c, d: c - d):7.0f} %")
    print(f"share of the equations            {share(lambda b, c, d: b - c):7.0f} %")


if __name__ == "__main__":
    main()
