"""Cost of the runs of a study, and of 100 million of them: `python benchmarks/studies.py`.

Runs of Fig. 4 from random starts are made by one worker process and by two, alternately, with each
engine. Then empty runs are made in the same way, in normal blocks and in blocks of one run: their
time is spent in the process that sends runs and stores results, for a run and for a block. From
these, the last lines extrapolate to a large study on a large cluster.

Processor time is measured in the worker processes, so a busy machine does not matter; the gain of
two workers is in wall-clock time, and needs both cores.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, islice
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np
from measuring import python

from orchestrator.runs.preparation import Prepared, load_scenario, prepare
from orchestrator.runs.request import Request
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.columns import Numbers, Outcomes, Points, Texts
from orchestrator.studies.engine import Engine, FmuEngine
from orchestrator.studies.space import Space
from orchestrator.studies.store import open_store
from orchestrator.studies.study import study_of
from orchestrator.studies.sweep import making_runs
from orchestrator.vehicle.indices import index_columns

SCENARIO = "fig4"

#: Blocks that each worker makes before the measurement, to load FMUs, compile programs, and settle
#: the length of blocks.
_WARM = 3

#: Runs for a rough estimate of the time of one.
_TRIED = 5


def plain(numbers: np.ndarray, values: np.ndarray, *columns: str) -> Outcomes:
    """Outcomes of runs that succeed."""
    none = Texts(np.zeros(len(numbers), dtype=np.int32))
    return Outcomes(numbers, columns, values, none, none)


class Timed(NamedTuple):
    """An engine whose only result is the processor time of each run."""

    engine: Engine
    least_runs: int = 1
    most_runs: int = 10_000
    digest: str = "timed"

    def outcomes(self, points: Points) -> Iterator[Outcomes]:
        """Make runs, as the engine makes them; each of some at a time gets the same share."""
        start = process_time()
        for made in self.engine.outcomes(points):
            seconds = (process_time() - start) / len(made)
            yield plain(made.numbers, np.full((len(made), 1), seconds), "seconds")
            start = process_time()


class Idle(NamedTuple):
    """An engine whose runs take no time."""

    least_runs: int = 1
    most_runs: int = 10_000
    digest: str = "idle"

    def outcomes(self, points: Points) -> Iterator[Outcomes]:
        """Return numbers of no meaning."""
        columns = index_columns()
        values = 0.1 * points.numbers[:, np.newaxis] + np.zeros(len(columns))
        yield plain(points.numbers, values, *columns)


class Cost(NamedTuple):
    """Time of each run [s]."""

    processor: float
    wall: float


def cost(engine: Engine, points: Iterable[Points], workers: int) -> Cost:
    """Time of runs that several processes make."""
    with making_runs(Timed(engine), points, workers=workers) as blocks:
        for _ in islice(blocks, _WARM * workers):
            pass
        start = perf_counter()
        seconds = [*chain(*(block.indices[:, 0].tolist() for block in blocks))]
        return Cost(median(seconds), (perf_counter() - start) / len(seconds))


def first(space: Space, n: int, size: int = Idle().most_runs) -> Iterator[Points]:
    """The first runs, some at a time."""
    return map(space.points, Numbers((0, n)).blocks(size))


def prepared(kind: str) -> Prepared:
    """The scenario with FMUs of a kind."""
    return prepare(*load_scenario(SCENARIO, kind), Request(kind=kind))


def starts(n: int, stop_time: float) -> Space:
    """Runs from random starts."""
    ranges = {"plant.eta0.y": [-10.0, 10.0], "plant.eta0.z": [-10.0, 10.0]}
    sample = {"method": "random", "n": n, "seed": 1, "range": ranges}
    study = study_of("starts", {"scenario": SCENARIO, "stop_time": stop_time, "sample": sample})
    return Space(study, {SCENARIO: load_scenario(SCENARIO)})


def keeping(n: int) -> tuple[float, float, float]:
    """Seconds of this process and bytes of the unfinished and the finished table, for each run."""
    space = starts(n, 1.0)
    start = process_time()
    with (
        TemporaryDirectory(prefix="auvfmu") as folder,
        open_store(Path(folder), {"made_of": {}}, space.indices) as unfinished,
    ):
        assert unfinished is not None
        with making_runs(Idle(), first(space, n), workers=1) as blocks:
            for outcomes in blocks:
                unfinished.add(outcomes)
        database = sum(file.stat().st_size for file in Path(folder).glob("unfinished*"))
        unfinished.publish(space)
        table = Path(folder, "runs.parquet").stat().st_size
    return (process_time() - start) / n, database / n, table / n


def block(n: int) -> float:
    """Seconds of an empty block, from sending to its result."""
    space = starts(n, 1.0)
    with making_runs(Idle(most_runs=1), first(space, n), workers=1) as blocks:
        start = perf_counter()
        made = sum(1 for _ in blocks)
        return (perf_counter() - start) / made


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stop-time", type=float, default=60.0, help="of a run [s]")
    parser.add_argument("--seconds", type=float, default=10.0, help="a measurement takes")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--runs", type=float, default=1e8, help="of the large study")
    parser.add_argument("--nodes", type=int, default=100, help="of the large cluster")
    parser.add_argument("--cores", type=int, default=16, help="of each of its nodes")
    options = parser.parse_args()
    print(f"{python()}, {os.cpu_count()} cores, runs of {options.stop_time:g} s")
    engines: dict[str, Callable[[], Engine]] = {
        "FMUs in Python": lambda: FmuEngine({SCENARIO: prepared("python")}),
        "FMUs in C": lambda: FmuEngine({SCENARIO: prepared("native")}),
        "batch engine": lambda: BatchEngine({SCENARIO: load_scenario(SCENARIO)[1]}),
    }
    costs = {}
    for name, make in engines.items():
        engine = make()
        space = starts(1_000_000, options.stop_time)
        tried = Timed(engine).outcomes(space.points(np.arange(_TRIED)))
        once = min(float(outcomes.indices.min()) for outcomes in tried)
        n = 2 * _WARM + round(options.seconds / once)
        pairs = [
            [cost(engine, first(space, n), workers) for workers in (1, 2)]
            for _ in range(options.repetitions)
        ]
        alone, paired = (min(pair[i].processor for pair in pairs) for i in (0, 1))
        gain = max(pair[0].wall / pair[1].wall for pair in pairs)
        costs[name] = alone
        print(
            f"{name:15}{1e3 * alone:9.3f} ms of processor time a run by one worker,"
            f"{1e3 * paired:9.3f} ms by each of two"
        )
        print(f"{'':15}two workers make {gain:.2f} times as many runs")
    run, database, table = keeping(100_000)
    print(f"who sends and keeps them: {1e6 * run:.0f} us of processor time a run")
    print(f"{database:.0f} bytes a run until all are done, and {table:.0f} bytes of Parquet")
    print(f"a block of runs: {1e3 * block(1000):.1f} ms to get there and back")

    cores = options.nodes * options.cores
    print(f"{options.runs:g} runs on {options.nodes} nodes of {options.cores} cores:")
    for name, alone in costs.items():
        total = options.runs * alone / 3600
        print(
            f"{name:15}{total:10,.0f} core hours,{total / cores:8.2f} h by all cores; "
            f"who sends them keeps up with {alone / run:,.0f}"
        )
    keep = options.runs * run / 3600
    print(
        f"who sends and keeps them: {keep:.1f} h, {options.runs * (database + table) / 1e9:.0f} GB"
    )


if __name__ == "__main__":
    main()
