"""The runs of all variants, and the numbers of the printed table read off them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from orchestrator.analysis.signals import ACTUATORS, AXES, COMMANDED
from orchestrator.experiments.preparation import loaded
from orchestrator.master.table import Table
from orchestrator.paper.choices import END_TIMES, OF_RUNS, SIGNALS, Choice, options_of, runs
from orchestrator.paper.measures import Way, way
from orchestrator.paper.sensitivity import PUBLISHED, Sensitivity
from orchestrator.paper.workers import Workers
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Outcome, Run
from orchestrator.studies.sweep import check_installed

#: Runs that a worker makes at a time.
_BLOCK = 16

#: Indices of an outcome.
_EFFORT = [f"l2_effort.{k}" for k in ACTUATORS]
_ERROR = [f"final_error.{k}" for k in AXES]
_INDICES = (*_EFFORT, *_ERROR)
_REACHED = "time_to_reach"

#: u, r and q of (u, q, r).
_EXCHANGED = [0, 2, 1]


def all_variants(crew: Workers, of_runs: Sequence[Choice] = OF_RUNS) -> Sensitivity:
    """Make the runs of all combinations.

    Args:
        crew: that makes them.
        of_runs: choices that they depend on.

    Raises:
        InputError: a package is missing.
        KeyboardInterrupt: the user does not want to wait.

    """
    check_installed()
    engine = BatchEngine({scenario: loaded(scenario)[1] for scenario in PUBLISHED})
    wanted = {scenario: list(runs(scenario, of_runs)) for scenario in PUBLISHED}
    blocks = {
        (scenario, first): partial(taken_of, engine, found[first : first + _BLOCK])
        for scenario, found in wanted.items()
        for first in range(0, len(found), _BLOCK)
    }
    taken = dict(crew.results(blocks, "block of runs"))
    numbers, ways = {}, {}
    for scenario, found in wanted.items():
        parts = [taken[scenario, first] for first in range(0, len(found), _BLOCK)]
        sizes = [len(options_of(choice, scenario)) for choice in of_runs]
        sixes, pairs = map(np.concatenate, zip(*parts, strict=True))
        numbers[scenario] = sixes.reshape(*sizes, *sixes.shape[1:])
        ways[scenario] = pairs.reshape(*sizes, *pairs.shape[1:])
    return Sensitivity(numbers, ways, of_runs)


def taken_of(engine: BatchEngine, block: Sequence[Run]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and ways of some runs, an axis for the runs first; a task for a worker.

    Those of a run that has failed are not numbers, nor is the way of one that has not arrived.
    """
    numbers = np.full((len(block), len(SIGNALS), len(END_TIMES), len(_INDICES)), np.nan)
    ways = np.full((len(block), len(Way._fields)), np.nan)
    for i, run in enumerate(block):
        outcomes = engine.outcomes_at(run, END_TIMES)
        if outcomes[-1].failure is None:
            table = engine.table(run)
            numbers[i] = numbers_of(outcomes, table)
            ways[i] = way(table, outcomes[-1].indices.get(_REACHED)) or np.nan
    return numbers, ways


def numbers_of(outcomes: Sequence[Outcome], table: Table) -> np.ndarray:
    """Three L2 efforts and three e_f, an axis each for SIGNALS and END_TIMES before the six.

    Args:
        outcomes: of a run, at each of END_TIMES.
        table: its rows, for what no index is of.

    """
    applied, error = (
        np.array([[outcome.indices[name] for name in names] for outcome in outcomes])
        for names in (_EFFORT, _ERROR)
    )
    h = np.diff(table.time)[:, np.newaxis]
    squares = np.cumsum(table.group(*COMMANDED)[1:] ** 2 * h, axis=0)
    # The steps that end there: half a step is more than times are rounded by.
    ends = np.searchsorted(table.time[1:], np.subtract(END_TIMES, 0.5 * table.time[1]))
    commanded = np.sqrt(squares[ends])
    return np.stack(
        [np.hstack((effort, error)) for effort in (applied, commanded, applied[:, _EXCHANGED])]
    )
