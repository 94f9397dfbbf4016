"""The runs of all variants, and the numbers of the printed table read off them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from orchestrator.machine.workers import Workers
from orchestrator.master.observers.table import Table
from orchestrator.paper.choices import (
    END_TIMES,
    OF_RUNS,
    OF_RUNS_OF_FIVE,
    SIGNALS,
    Choice,
    options_of,
    runs,
)
from orchestrator.paper.measures import Approach, approach_of
from orchestrator.paper.sensitivity import (
    FARTHEST,
    PUBLISHED,
    QUANTILES,
    SEARCHED,
    SHOWN,
    Found,
    Sensitivity,
    Variant,
)
from orchestrator.runs.loading import loaded
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Point
from orchestrator.studies.sweep import check_installed
from orchestrator.vehicle.reducers import LAST_SECONDS
from orchestrator.vehicle.signals import AXES, STANDARD, parameter

#: Runs that a worker makes at a time.
_BLOCK = 16


def all_variants(
    crew: Workers,
    of_runs: Sequence[Choice] = OF_RUNS,
    of_five: Sequence[Choice] = OF_RUNS_OF_FIVE,
    searched: Sequence[int] = SEARCHED,
    shown: Sequence[int] = SHOWN,
) -> Found:
    """Make the runs of all combinations.

    Args:
        crew: that makes them.
        of_runs: choices that they depend on.
        of_five: the same with five degrees of freedom.
        searched: starts that those with five are searched with.
        shown: starts of the variants whose numbers are printed.

    Raises:
        InputError: a package is missing.
        KeyboardInterrupt: the user does not want to wait.

    """
    check_installed()
    engine = BatchEngine({scenario: loaded(scenario)[1] for scenario in PUBLISHED})
    six = _six(crew, engine, of_runs)
    five = _five(crew, engine, of_five, searched)
    nearest = (
        (six, six.ours),
        (six, six.nearest(consistent=True)),
        (six, six.nearest(consistent=False)),
        (five, five.nearest(consistent=True)),
    )
    tasks = {
        (i, scenario): partial(quantiles_of, engine, _run_of(found, variant, scenario), shown)
        for i, (found, variant) in enumerate(nearest)
        for scenario in PUBLISHED
    }
    taken = dict(crew.results(tasks, "variant"))
    printed = tuple(
        found.over_starts(variant, {scenario: taken[i, scenario] for scenario in PUBLISHED})
        for i, (found, variant) in enumerate(nearest)
    )
    return Found(six, five, printed)


def _six(crew: Workers, engine: BatchEngine, of_runs: Sequence[Choice]) -> Sensitivity:
    """Each combination by one run."""
    blocks = {
        (scenario, first): partial(taken_of, engine, found[first : first + _BLOCK])
        for scenario in PUBLISHED
        for found in [list(runs(scenario, of_runs))]
        for first in range(0, len(found), _BLOCK)
    }
    taken = dict(crew.results(blocks, "block of runs"))
    numbers, approaches = {}, {}
    for scenario in PUBLISHED:
        parts = (taken[block] for block in blocks if block[0] == scenario)
        sixes, pairs = map(np.concatenate, zip(*parts, strict=True))
        numbers[scenario] = _by_choice(sixes, scenario, of_runs)
        approaches[scenario] = _by_choice(pairs, scenario, of_runs)
    return Sensitivity(numbers, approaches, of_runs)


def _five(
    crew: Workers, engine: BatchEngine, of_runs: Sequence[Choice], starts: Sequence[int]
) -> Sensitivity:
    """Each combination by medians over starts."""
    tasks = {
        (scenario, run.number): partial(quantiles_of, engine, run, starts)
        for scenario in PUBLISHED
        for run in runs(scenario, of_runs)
    }
    taken = dict(crew.results(tasks, "variant of five degrees of freedom"))
    middle = QUANTILES.index(0.5)
    numbers, approaches = {}, {}
    for scenario in PUBLISHED:
        medians = np.stack([taken[task][middle] for task in tasks if task[0] == scenario])
        numbers[scenario] = _by_choice(medians, scenario, of_runs)
        approaches[scenario] = np.full(
            (*numbers[scenario].shape[:-3], len(Approach._fields)), np.nan
        )
    return Sensitivity(numbers, approaches, of_runs)


def _by_choice(found: np.ndarray, scenario: str, of_runs: Sequence[Choice]) -> np.ndarray:
    """With an axis for each choice in place of one for the runs."""
    return found.reshape(*(len(options_of(each, scenario)) for each in of_runs), *found.shape[1:])


def _run_of(found: Sensitivity, variant: Variant, scenario: str) -> Point:
    """The run of a variant in a scenario."""
    shape = found.numbers[scenario].shape[: len(found.of_runs)]
    options = np.minimum(variant.options[: len(shape)], np.subtract(shape, 1))
    all_runs = list(runs(scenario, found.of_runs))
    return all_runs[int(np.ravel_multi_index(tuple(options), shape))]


def taken_of(engine: BatchEngine, block: Sequence[Point]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and ways of some runs, an axis for the runs first; a task for a worker.

    Of a run that has failed they are not numbers, nor is the way of one that has not arrived.
    """
    tables = [engine.table(run) for run in block]
    approaches = [approach_of(table, errors(table)) or (np.nan, np.nan) for table in tables]
    return np.stack([numbers_of(table) for table in tables]), np.array(approaches)


def quantiles_of(engine: BatchEngine, run: Point, starts: Sequence[int]) -> np.ndarray:
    """The numbers of a run from moved starts, an axis for QUANTILES first; a task for a worker."""
    found = [numbers_of(engine.table(each)) for each in moved(engine, run, starts)]
    quantiles: np.ndarray = np.quantile(found, QUANTILES, axis=0)
    return quantiles


def moved(engine: BatchEngine, run: Point, starts: Sequence[int]) -> Iterator[Point]:
    """A run from starts that are moved by :data:`FARTHEST` at most, each by its number."""
    start = engine.setting(run).plant.eta0[: len(AXES)]
    for number in starts:
        away = np.random.default_rng(number).uniform(-FARTHEST, FARTHEST, len(AXES))
        values = zip(AXES, np.add(start, away).tolist(), strict=True)
        yield run._replace(
            parameters={**run.parameters, **{f"plant.eta0.{axis}": x for axis, x in values}}
        )


def errors(table: Table) -> np.ndarray:
    """e of all rows at once, far sooner than :func:`.tracking_error` and equal up to rounding."""
    _, theta, psi = table.group(*STANDARD.attitude).T
    ahead = np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)
    y = table.group(*STANDARD.position) + parameter(table, STANDARD.ell) * np.column_stack(ahead)
    error: np.ndarray = y - table.group(*STANDARD.y_d)
    return error


def numbers_of(table: Table) -> np.ndarray:
    """Three L2 norms and three e_f, an axis each for SIGNALS and END_TIMES before the six.

    Args:
        table: of a run until the last of END_TIMES; what has failed before gives no numbers.

    """
    if table.time[-1] < END_TIMES[-1] - table.time[1]:
        return np.full((len(SIGNALS), len(END_TIMES), 6), np.nan)
    h = np.diff(table.time)[:, np.newaxis]
    # Half a step is more than times are rounded by.
    ends = np.searchsorted(table.time, np.subtract(END_TIMES, 0.5 * table.time[1]))
    begins = np.searchsorted(table.time, table.time[ends] - LAST_SECONDS)
    error = np.abs(errors(table))
    final = np.stack([error[i : k + 1].max(axis=0) for i, k in zip(begins, ends, strict=True)])
    # A row holds the signal of the step that ends there: the first one holds none.
    efforts = (
        np.sqrt(np.cumsum(table.group(*names)[1:] ** 2 * h, axis=0)[ends - 1])
        for names in (STANDARD.applied, STANDARD.commanded)
    )
    return np.stack([np.hstack((effort, final)) for effort in efforts])
