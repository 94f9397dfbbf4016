"""Time of a step of a vehicle in the batch engine: `python benchmarks/batch.py`.

Every repetition makes a run of each of some scenarios, one after the other in this process, and
takes the processor's time:

- by FMUs in C, in the compiled loop;
- by the batch engine.

Both make all indices. Printed are medians of the repetitions, ratios being taken within each
repetition. Then runs of one second are made, more and more of them, and the time of each is printed
with the memory of the process.

`--check N` instead makes N random runs of every ready study in full length, and counts the runs
that are the same with both, to the last bit.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from random import Random
from statistics import median
from time import process_time

from measuring import options, python, resident, timed

from fmus.kinds import NATIVE
from orchestrator.runs.preparation import load_scenario, prepare
from orchestrator.runs.request import Request
from orchestrator.studies.batch_engine import REFUSED, BatchEngine
from orchestrator.studies.columns import Point
from orchestrator.studies.engine import Engine, FmuEngine, outcomes_of
from orchestrator.studies.space import Space
from orchestrator.studies.study import read_study, ready_studies

#: Runs that are timed: noise is drawn in the first, and three vehicles are in the last.
_SCENARIOS = ("fig4", "fig5", "fig5-pd", "path", "sea", "remus", "formation-v")
_STEP = 0.02

#: Numbers of short runs.
_MANY = (100, 1_000, 10_000, 100_000)


def engines(names: Sequence[str]) -> tuple[FmuEngine, BatchEngine]:
    """Both engines for some scenarios."""
    ready = {name: prepare(*load_scenario(name, NATIVE), Request(kind=NATIVE)) for name in names}
    return FmuEngine(ready), BatchEngine(
        {name: prepared.system for name, prepared in ready.items()}
    )


def processor(function: Callable[[], object]) -> float:
    """Processor time of one call [s]."""
    return timed(function, process_time)


def make(engine: Engine, points: Iterable[Point]) -> None:
    """Make runs and forget them."""
    deque(outcomes_of(engine, points), maxlen=0)


def compare(both: Sequence[Engine], steps: int, repetitions: int) -> None:
    """Print the time of a step."""
    print(f"medians of {repetitions} repetitions of {steps} steps, processor's time")
    for name in _SCENARIOS:
        points = [Point(0, name, {}, steps * _STEP, _STEP)]
        for engine in both:
            make(engine, points)
        rows = [
            [processor(partial(make, engine, points)) for engine in both]
            for _ in range(repetitions)
        ]
        a, b = (1e6 * median(times) / steps for times in zip(*rows, strict=True))
        ratio = median(slow / fast for slow, fast in rows)
        print(
            f"{name:11} FMUs in C {a:6.2f} us a step, batch engine {b:6.3f} us: "
            f"{ratio:.1f} times as fast"
        )


def grow(engine: BatchEngine) -> None:
    """Print time and memory of many runs."""
    print(f"{'runs':>8} {'us a run':>9} {'resident [MB]':>14}")
    for n in _MANY:
        points = (Point(i, "fig5", {"plant.eta0.y": float(i % 7)}, 1.0, _STEP) for i in range(n))
        seconds = processor(partial(make, engine, points))
        print(f"{n:8} {1e6 * seconds / n:9.1f} {resident():14.1f}")


def check(n: int) -> None:
    """Print the number of runs of the ready studies that both engines make alike."""
    for name in ready_studies():
        study = read_study(name)
        fmus, batch = engines(study.scenario)
        space = Space(study, {name: load_scenario(name, NATIVE) for name in study.scenario})
        points = [space[number] for number in Random(name).sample(range(len(space)), n)]
        same = sum(
            bool(expected.failure) if outcome.failure == REFUSED else outcome == expected
            for outcome, expected in zip(
                *(outcomes_of(engine, points) for engine in (batch, fmus)), strict=True
            )
        )
        print(f"{name:12} {same} of {n} runs are the same", flush=True)


def main() -> None:
    """Measure and print."""
    parser = options(__doc__)
    parser.add_argument("--check", type=int, metavar="N", help="compare N runs of every study")
    given = parser.parse_args()
    print(python())
    if given.check:
        check(given.check)
        return
    both = engines(_SCENARIOS)
    compare(both, given.steps, given.repetitions)
    grow(both[1])


if __name__ == "__main__":
    main()
