"""What a step of a vehicle costs in the batch engine: `python benchmarks/batch.py`.

Every repetition makes the runs of Figs. 4 and 5 with either controller, one after the other in this
process, and takes the processor's time:

- by the straight line `auv_fmu.loop.closed_loop`;
- by the batch engine, with all indices.

Printed are medians of the repetitions, ratios being taken within each repetition. Then runs of one
second are made, more and more of them, and the time of each is printed with the memory of the
process.

`--check N` instead makes N random runs of every ready study in full length, and counts those that
end in the same state as the straight line, to the last bit.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from random import Random
from statistics import median
from time import process_time

from measuring import options, python, resident, timed

from auv_fmu.loop.closed_loop import Setting, closed_loop
from orchestrator.master.experiment import Experiment
from orchestrator.runs.loading import load, load_scenario
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Point
from orchestrator.studies.space import Space
from orchestrator.studies.study import BATCH, ready_studies
from orchestrator.studies.study_file import read_study
from orchestrator.system.structure import System
from orchestrator.vehicle.signals import STANDARD

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
from parts.straight_line import setting_of

#: Runs that are timed: noise is drawn in the first.
_SCENARIOS = ("fig4", "fig5", "fig5-pd")
_STEP = 0.02

#: How many short runs are made.
_MANY = (100, 1_000, 10_000, 100_000)


def processor(function: Callable[[], object]) -> float:
    """Processor's seconds of one call."""
    return timed(function, process_time)


def make(engine: BatchEngine, points: Iterable[Point]) -> None:
    """Make runs and forget them."""
    deque(engine.outcomes(points), maxlen=0)


def straight(setting: Setting, steps: int) -> None:
    """Make a run and forget it."""
    deque(closed_loop(steps, setting), maxlen=0)


def compare(systems: Mapping[str, System], steps: int, repetitions: int) -> None:
    """Print what a step costs."""
    engine = BatchEngine(systems)
    print(f"medians of {repetitions} repetitions of {steps} steps, processor's time")
    for name in _SCENARIOS:
        point = Point(0, name, {}, steps * _STEP, _STEP)
        setting = setting_of(systems[name], point)
        make(engine, [point])
        rows = [
            (
                processor(partial(straight, setting, steps)),
                processor(partial(make, engine, [point])),
            )
            for _ in range(repetitions)
        ]
        a, b = (1e6 * median(times) / steps for times in zip(*rows, strict=True))
        ratio = median(slow / fast for slow, fast in rows)
        print(
            f"{name:8} straight line {a:6.2f} us a step, batch engine {b:5.3f} us: "
            f"{ratio:.0f} times as fast"
        )


def grow(engine: BatchEngine) -> None:
    """Print what runs cost where there are many."""
    print(f"{'runs':>8} {'us a run':>9} {'resident [MB]':>14}")
    for n in _MANY:
        points = (Point(i, "fig5", {"plant.eta0.y": float(i % 7)}, 1.0, _STEP) for i in range(n))
        seconds = processor(partial(make, engine, points))
        print(f"{n:8} {1e6 * seconds / n:9.1f} {resident():14.1f}")


def check(n: int) -> None:
    """Print how many runs of the ready studies of this engine end as the straight line does."""
    for name in ready_studies():
        study = read_study(name)
        if study.engine != BATCH:
            continue
        loaded = {one: load_scenario(one) for one in study.scenario}
        systems = {one: system for one, (_, system) in loaded.items()}
        engine, space = BatchEngine(systems), Space(study, loaded)
        points = [space[number] for number in Random(name).sample(range(len(space)), n)]
        same = sum(is_straight(engine, systems[point.scenario], point) for point in points)
        print(f"{name:12} {same} of {n} runs end in the same state", flush=True)


def is_straight(engine: BatchEngine, system: System, point: Point) -> bool:
    """Whether a run ends in the state in which the straight line ends, which has equal steps."""
    experiment = Experiment(point.stop_time, point.step, point.order)
    point = point._replace(stop_time=experiment.time(experiment.full_steps))
    table = engine.table(point)
    delayed = point.order == "jacobi"
    *_, before, last = closed_loop(len(table) - 1, setting_of(system, point), delayed)
    state = (before if table.header.experiment.acting_row else last).controller_state
    theta_hat = getattr(state, "theta_hat", state)
    ends = (*last.vehicles.plant.position, *last.scene.plant.nu, *theta_hat)
    return ends == tuple(table.group(*STANDARD.position, *STANDARD.nu, *STANDARD.theta_hat)[-1])


def main() -> None:
    """Measure and print."""
    parser = options(__doc__)
    parser.add_argument("--check", type=int, metavar="N", help="compare N runs of every study")
    given = parser.parse_args()
    print(python())
    if given.check:
        check(given.check)
        return
    systems = {name: load(name) for name in _SCENARIOS}
    compare(systems, given.steps, given.repetitions)
    grow(BatchEngine(systems))


if __name__ == "__main__":
    main()
