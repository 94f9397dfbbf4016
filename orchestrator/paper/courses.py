"""Courses of runs, and the numbers of the printed table read off them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from orchestrator.analysis.metrics import LAST_SECONDS
from orchestrator.analysis.signals import APPLIED, COMMANDED
from orchestrator.experiments.result import simulate
from orchestrator.paper.choices import END_TIMES, OF_RUNS, SIGNALS, Choice, options_of, runs
from orchestrator.paper.measures import Way, way
from orchestrator.paper.sensitivity import PUBLISHED, Sensitivity
from orchestrator.paper.workers import Workers
from orchestrator.studies.engine import Run

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


def all_variants(crew: Workers, of_runs: Sequence[Choice] = OF_RUNS) -> Sensitivity:
    """Make the runs of all combinations.

    Args:
        crew: that makes them.
        of_runs: choices that they depend on.

    Raises:
        KeyboardInterrupt: the user does not want to wait.

    """
    wanted = {scenario: list(runs(scenario, of_runs)) for scenario in PUBLISHED}
    blocks = {
        (scenario, first): partial(taken_of, found[first : first + _BLOCK])
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


def taken_of(block: Sequence[Run]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and ways of some runs, an axis for the runs first; a task for a worker.

    Those of a run that has failed are not numbers, nor is the way of one that has not arrived.
    """
    numbers = np.full((len(block), len(SIGNALS), len(END_TIMES), 6), np.nan)
    ways = np.full((len(block), 2), np.nan)
    for i, run in enumerate(block):
        try:
            result = simulate(
                run.scenario,
                dict(run.parameters),
                stop_time=run.stop_time,
                step=run.step,
                order=run.order,
                kind="native",
                loop="compiled",
            )
        except ValueError:
            continue
        if result.failure is None:
            course = Course(
                result.time, result.group(*COMMANDED), result.group(*APPLIED), _err(result)
            )
            numbers[i] = course.numbers()
            ways[i] = course.way or np.nan
    return numbers, ways


def _err(r):
    x, y, z, ph, th, ps = r.group(
        "plant.eta.x",
        "plant.eta.y",
        "plant.eta.z",
        "plant.eta.phi",
        "plant.eta.theta",
        "plant.eta.psi",
    ).T
    return np.stack(
        (
            x + 0.35 * np.cos(th) * np.cos(ps),
            y + 0.35 * np.cos(th) * np.sin(ps),
            z - 0.35 * np.sin(th),
        ),
        1,
    ) - r.group("planner.y_d.x", "planner.y_d.y", "planner.y_d.z")
