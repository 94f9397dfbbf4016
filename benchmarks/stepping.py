"""Time of stepping by hand: `python benchmarks/stepping.py`.

Fig. 4 in :class:`Simulation`: a step, with rows kept and without; a step after which the position
is read; a step with a command set before; saving and restoring; all with the program and with the
FMUs in C. Then :class:`Simulations`, many at once on all cores: run to 10 s in one call, beside the
batch engine with as many threads, and step by step with the positions read and commands set.

Printed are medians of the repetitions, ratios being taken within each repetition.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from statistics import median

import numpy as np
from measuring import options, python, timed

from auv_fmu import Simulation, Simulations
from fmus.kinds import NATIVE
from orchestrator.runs.preparation import load_scenario, prepare
from orchestrator.runs.request import Request
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.columns import Point
from orchestrator.studies.engine import outcomes_of

#: Numbers of simulations at once, and the end of their run [s].
_MANY = (1, 100, 1_000, 10_000)
_END, _STEP = 10.0, 0.02


def single(loop: str, steps: int, repetitions: int) -> None:
    """Print the times of one simulation."""
    sim = Simulation("fig4", kind=NATIVE, loop=loop)  # type: ignore[arg-type]
    bare = Simulation("fig4", kind=NATIVE, loop=loop, keep=False)  # type: ignore[arg-type]
    state = bare.save()

    def read() -> None:
        bare.step()
        bare["plant.eta"]

    def command() -> None:
        bare["plant.tau.u"] = 12.0
        bare.step()

    actions: dict[str, Callable[[], object]] = {
        "step": sim.step,
        "step, no rows": bare.step,
        "step and read": read,
        "set and step": command,
        "save": bare.save,
        "restore": lambda: bare.restore(state),
        "reset": bare.reset,
    }
    for name, act in actions.items():
        n = steps if name != "reset" else steps // 10

        def repeat(act: Callable[[], object] = act, n: int = n) -> None:
            for _ in range(n):
                act()

        times = [1e6 * timed(repeat) / n for _ in range(repetitions)]
        print(f"{loop:9} {name:14} {median(times):8.1f} us")
        bare.reset()
        sim.reset()


def many(n: int, repetitions: int) -> None:
    """Print the times of many simulations, beside the batch engine."""
    steps, threads = round(_END / _STEP), os.cpu_count() or 1
    prepared = prepare(*load_scenario("fig4", NATIVE), Request(kind=NATIVE))
    engine = BatchEngine({"fig4": prepared.system})
    engine.prepare(point := Point(0, "fig4", {}, _END, _STEP))
    sims = Simulations("fig4", n)
    commands = np.zeros((n, 3))

    def batch() -> None:
        def make(count: int) -> None:
            for _ in outcomes_of(engine, [point] * count):
                pass

        with ThreadPoolExecutor(threads) as pool:
            shares = np.diff(np.linspace(0, n, threads + 1).astype(int)).tolist()
            list(pool.map(make, shares))

    def in_one_call() -> None:
        sims.reset()
        sims.run(until=_END)

    def by_hand() -> None:
        sims.reset()
        for _ in range(steps // 10):
            sims["plant.tau"] = commands
            sims.step()
            sims["plant.eta"].sum()

    rows = [[timed(each) for each in (in_one_call, batch, by_hand)] for _ in range(repetitions)]
    ours, theirs, stepped = (median(times) for times in zip(*rows, strict=True))
    ratio = median(own / other for own, other, _ in rows)
    print(
        f"{n:6} at once: run {1e6 * ours / n / steps:6.2f} us a step, batch engine "
        f"{1e6 * theirs / n / steps:6.2f}, ratio {ratio:.2f}; set, step and read "
        f"{1e6 * stepped / n / (steps // 10):6.2f} us"
    )


def main() -> None:
    """Measure and print."""
    given = options(__doc__).parse_args()
    print(f"{python()}, {os.cpu_count()} cores; medians of {given.repetitions} repetitions")
    for loop in ("program", "compiled"):
        single(loop, given.steps if loop == "program" else given.steps // 10, given.repetitions)
    for n in _MANY:
        many(n, given.repetitions if n < _MANY[-1] else 3)


if __name__ == "__main__":
    main()
