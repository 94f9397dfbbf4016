"""Performance indices of a run: equation (59) and e_f of section 4.2."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from orchestrator.master.observers.observer import Ending, Header
from orchestrator.master.observers.table import Table
from orchestrator.system.structure import System
from orchestrator.vehicle.signals import (
    APPLIED,
    COMMANDED,
    LIMITS,
    TRACKING,
    limits,
    tracking_error,
)

#: T_L of section 4.2 [s].
LAST_SECONDS = 5.0


class Metrics:
    """An observer that computes the indices on the way; it keeps no more than the last seconds.

    Indices whose columns a system does not have are left out.
    """

    def begin(self, header: Header) -> None:
        """Find out which indices there will be."""
        self._header = header
        first = Table.of(header, np.empty((0, 1 + len(header.columns))))
        self._effort = None
        if not first.missing((*COMMANDED, *APPLIED), LIMITS):
            self._effort = _Effort(first)
        self._has_error = not first.missing(*TRACKING)
        self._recent: deque[np.ndarray] = deque()
        self._end = 0.0

    def take(self, rows: np.ndarray) -> None:
        """Take some rows into account."""
        self._end = float(rows[-1, 0])
        if self._effort is not None:
            self._effort.take(Table.of(self._header, rows))
        if self._has_error:
            self._recent.append(rows.copy())
            while self._recent[0][-1, 0] < self._end - LAST_SECONDS:
                self._recent.popleft()

    def end(self, ending: Ending) -> None:
        """Remember how the run has ended."""
        self._failure = ending.failure

    def values(self, scenario: str, system: System) -> dict[str, Any]:
        """What metrics.json holds.

        Args:
            scenario: its name.
            system: that was run.

        """
        experiment = self._header.experiment
        values: dict[str, Any] = {
            "scenario": scenario,
            "stop_time": self._end,
            "step": experiment.step,
            "order": experiment.order,
            "parameters": changed_parameters(system, self._header),
        }
        if self._failure is not None:
            values["failure"] = self._failure
        return values | self.indices()

    @np.errstate(all="ignore")
    def indices(self) -> dict[str, list[float]]:
        """The indices alone: those of the actuators in the order u, q, r, e_f in x, y, z."""
        found: dict[str, list[float]] = {}
        if self._effort is not None and self._effort.steps:
            found |= self._effort.indices()
        # Before the first step nothing has been followed.
        if self._has_error and self._end > self._header.experiment.start_time:
            found["final_error"] = self._final_error().tolist()
        return found

    def _final_error(self) -> np.ndarray:
        """e_f of section 4.2: max |e| of each axis over the last T_L seconds [m]."""
        recent = np.vstack(self._recent)
        last = Table.of(self._header, recent[recent[:, 0] >= self._end - LAST_SECONDS])
        largest: np.ndarray = np.abs(tracking_error(last)).max(axis=0)
        return largest


class _Effort:
    """Efforts of the actuators, of the signal that a row holds for the step that ends there.

    `rms_effort` is (59); `l2_effort` is it without 1/T_f under the root, which has the size of
    the numbers the paper prints (reading 6). Both are of the applied signal. Sums go on row by
    row, so that they do not depend on the blocks in which rows come.
    """

    def __init__(self, header: Table) -> None:
        self.steps = 0
        self._lower, self._upper = limits(header)
        self._time = np.empty(0)
        self._applied = np.empty((0, 3))
        self._square, self._variation, self._peak = np.zeros(3), np.zeros(3), np.zeros(3)
        self._outside = np.zeros(3)

    def take(self, table: Table) -> None:
        time, applied, commanded = table.time, table.group(*APPLIED), table.group(*COMMANDED)
        if not len(self._time):
            # The first row of a run ends no step.
            self._time = time[:1].copy()
            time, applied, commanded = time[1:], applied[1:], commanded[1:]
        if not len(time):
            return
        h = np.diff(time, prepend=self._time)[:, np.newaxis]
        self._square = continued(self._square, applied**2 * h)
        differences = np.diff(np.vstack((self._applied, applied)), axis=0)
        self._variation = continued(self._variation, np.abs(differences))
        self._peak = np.maximum(self._peak, np.abs(commanded).max(axis=0))
        self._outside += ((commanded < self._lower) | (commanded > self._upper)).sum(axis=0)
        self.steps += len(time)
        self._time, self._applied = time[-1:].copy(), applied[-1:]

    def indices(self) -> dict[str, list[float]]:
        return {
            "l2_effort": np.sqrt(self._square).tolist(),
            "rms_effort": np.sqrt(self._square / self._time[-1]).tolist(),
            "peak_command": self._peak.tolist(),
            "saturated_fraction": (self._outside / self.steps).tolist(),
            "total_variation": self._variation.tolist(),
        }


def continued(total: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """A sum over rows, continued in their order."""
    continued: np.ndarray = np.vstack((total, terms)).sum(axis=0)
    return continued


def indices(table: Table) -> dict[str, list[float]]:
    """The indices of a run whose rows are all there."""
    return metrics_of(table).indices()


def metrics_of(table: Table) -> Metrics:
    """The indices of a run whose rows are all there, with what metrics.json says beside them."""
    metrics = Metrics()
    metrics.begin(table.header)
    metrics.take(table.rows)
    metrics.end(table.ending)
    return metrics


def changed_parameters(system: System, header: Header) -> dict[str, Any]:
    """Values of parameters, and of inputs that were set, that differ from the FMU's defaults."""
    return {
        str(name): value
        for name, value in {**header.parameters, **system.parameters}.items()
        if value != system.component(name.component).start(name.port)
    }
