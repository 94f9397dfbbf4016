"""Courses of runs, and the numbers of the printed table read off them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from orchestrator.analysis.metrics import LAST_SECONDS
from orchestrator.analysis.signals import APPLIED, COMMANDED, tracking_error
from orchestrator.errors import InputError
from orchestrator.experiments.preparation import loaded
from orchestrator.master.table import Table
from orchestrator.paper.choices import END_TIMES, OF_RUNS, SIGNALS, Choice, options_of, runs
from orchestrator.paper.measures import Way, way
from orchestrator.paper.sensitivity import PUBLISHED, Sensitivity
from orchestrator.paper.workers import Workers
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Run
from orchestrator.studies.sweep import check_installed

#: Runs that a worker makes at a time.
_BLOCK = 16

#: u, r and q of (u, q, r).
_EXCHANGED = [0, 2, 1]


class Course(NamedTuple):
    """What the printed numbers are read off: a row at t = 0, and one after each step.

    Attributes:
        time: [s].
        commanded, applied: (tau_u, tau_q, tau_r) of the step that ends with the row [N, N.m].
        error: e = y - y_d with the true control point [m].

    """

    time: np.ndarray
    commanded: np.ndarray
    applied: np.ndarray
    error: np.ndarray

    @property
    def way(self) -> Way | None:
        """To the reference."""
        return way(self.time, self.error, self.applied[:, 0])

    def numbers(self) -> np.ndarray:
        """Three L2 efforts and three e_f, an axis each for SIGNALS and END_TIMES before the six."""
        step = self.time[1]
        ends = np.searchsorted(self.time, np.subtract(END_TIMES, 0.5 * step))
        last = round(LAST_SECONDS / step) + 1
        windows = np.lib.stride_tricks.sliding_window_view(np.abs(self.error), last, axis=0)
        error = windows[ends + 1 - last].max(axis=-1)
        h = np.diff(self.time)[:, np.newaxis]
        applied, commanded = (
            np.sqrt(np.cumsum(signal[1:] ** 2 * h, axis=0)[ends - 1])
            for signal in (self.applied, self.commanded)
        )
        efforts = (applied, commanded, applied[:, _EXCHANGED])
        return np.stack([np.hstack((effort, error)) for effort in efforts])


def course_of(table: Table) -> Course:
    """The course of a run."""
    return Course(table.time, table.group(*COMMANDED), table.group(*APPLIED), tracking_error(table))


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
        each, way = map(np.concatenate, zip(*parts, strict=True))
        numbers[scenario] = each.reshape(*sizes, *each.shape[1:])
        ways[scenario] = way.reshape(*sizes, *way.shape[1:])
    return Sensitivity(numbers, ways, of_runs)


def taken_of(engine: BatchEngine, block: Sequence[Run]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and ways of some runs, an axis for the runs first; a task for a worker.

    Those of a run that has failed are not numbers, nor is the way of one that has not arrived.
    """
    numbers = np.full((len(block), len(SIGNALS), len(END_TIMES), 6), np.nan)
    ways = np.full((len(block), len(Way._fields)), np.nan)
    for i, run in enumerate(block):
        try:
            table = engine.table(run)
        except InputError:
            continue
        if table.ending.failure is None:
            course = course_of(table)
            numbers[i], ways[i] = course.numbers(), course.way or np.nan
    return numbers, ways
