"""The indices of a run of a study, from its rows."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from orchestrator.master.observers.observer import Ending, Header
from orchestrator.master.observers.table import Table
from orchestrator.studies.engine import REACHED
from orchestrator.vehicle.metrics import Metrics, continued
from orchestrator.vehicle.signals import (
    ACTUATORS,
    AXES,
    DRIFT,
    DY,
    DY_HAT,
    THETA_HAT,
    TRACKING,
    tracking_error,
)


class Indices:
    """An observer that computes the indices on the way; it keeps the last row and no others."""

    def begin(self, header: Header) -> None:
        """Find out which indices there will be."""
        self._header = header
        self._metrics = Metrics()
        self._metrics.begin(header)
        self._half = 0.5 * header.experiment.stop_time
        first = Table.of(header, np.empty((0, 1 + len(header.columns))))
        self._has_error = not first.missing(*TRACKING)
        self._has_estimate = not first.missing((*DY, *DY_HAT))
        self._has_theta = not first.missing(THETA_HAT)
        self._speeds = {
            name: group
            for name, group in {"largest_speed": DY, "largest_drift": DRIFT}.items()
            if not first.missing(group)
        }
        self._found: dict[str, float] = {}
        self._last = np.empty((0, 1 + len(header.columns)))
        self._squares, self._instants = np.zeros(len(AXES)), 0

    def take(self, rows: np.ndarray) -> None:
        """Take some rows into account."""
        self._metrics.take(rows)
        table = Table.of(self._header, rows)
        late = table.time >= self._half
        if self._has_error:
            self._take_error(table, late)
        if self._has_estimate:
            self._take_estimate(Table.of(self._header, np.vstack((self._last, rows))))
        if self._has_theta:
            theta_hat = table.group(*THETA_HAT)
            if late.any() and "theta_hat_half[1]" not in self._found:
                self._take_theta("half", theta_hat[late][0])
            self._take_theta("end", theta_hat[-1])
        for name, group in self._speeds.items():
            self._enlarge(name, size(table.group(*group)))
        self._last = rows[-1:].copy()

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def values(self) -> dict[str, float]:
        """The indices by their names."""
        return {
            f"{name}.{member}": value
            for name, values in self._metrics.indices().items()
            for member, value in zip(
                AXES if name == "final_error" else ACTUATORS, values, strict=True
            )
        } | self._rest()

    def _rest(self) -> dict[str, float]:
        if not self._instants:
            return self._found
        # One after the other: from Python 3.12 on `sum` makes up for what rounding loses.
        x, y, z = self._squares.tolist()
        return {**self._found, "estimate_error": sqrt((x + y + z) / self._instants)}

    def _take_error(self, table: Table, late: np.ndarray) -> None:
        # The control point takes as long as everything else together, and is not always wanted.
        wanted = late | ("time_to_reach" not in self._found)
        error = size(tracking_error(Table.of(self._header, table.rows[wanted])))
        reached = table.time[wanted][error <= REACHED]
        if len(reached):
            self._found.setdefault("time_to_reach", float(reached[0]))
        if late.any():
            self._enlarge("late_error", error[late[wanted]])

    def _take_estimate(self, table: Table) -> None:
        # A row holds the estimate of the instant at which its step began.
        late = table.time[:-1] >= self._half
        difference = (table.group(*DY_HAT)[1:] - table.group(*DY)[:-1])[late]
        self._squares = continued(self._squares, difference**2)
        self._instants += len(difference)

    def _take_theta(self, when: str, values: Sequence[float] | np.ndarray) -> None:
        self._found |= {
            f"theta_hat_{when}[{i}]": float(value) for i, value in enumerate(values, start=1)
        }

    def _enlarge(self, name: str, values: np.ndarray) -> None:
        self._found[name] = max(self._found.get(name, 0.0), float(values.max()))


def size(vectors: np.ndarray) -> np.ndarray:
    """The Euclidean norm of each row, summed in the order of its members."""
    squares = np.zeros(len(vectors))
    for column in vectors.T:
        squares = squares + column * column
    norm: np.ndarray = np.sqrt(squares)
    return norm
