"""What indices are made of: rows of one loop, and reducers that take them block by block.

Of several vehicles together there is one index, the smallest distance between them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from itertools import combinations
from operator import itemgetter

import numpy as np

from orchestrator.master.observers.table import Table
from orchestrator.vehicle.signals import Loop, Needs, applied, limits, tracking_error

#: T_L of section 4.2 [s].
LAST_SECONDS = 5.0

#: The index of several vehicles: its name in files, and in words.
SMALLEST_DISTANCE = "smallest_distance"
SMALLEST_DISTANCE_LABEL = "smallest distance between vehicles"

#: So many rows before its own a block takes along: the beginning of its first step, and the one
#: in which that step's predecessor may have what acted in it.
BEFORE = 2

#: So many numbers are compared at once.
_AT_ONCE = 1_000_000


class LoopRows:
    """Some rows of a run, and what indices of one loop take from them.

    Attributes:
        loop: whose signals count.
        number: of the first of them in the run, from 0; row 0 ends no step.
        start: of the run [s].
        half: when half of it is over [s].

    """

    def __init__(self, loop: Loop, number: int, table: Table, new: int) -> None:
        """Take rows.

        Args:
            loop: whose signals count.
            number: of the first of them in the run.
            table: of these rows, which begins with the ones before them, up to :data:`BEFORE`.
            new: how many those are.

        """
        self.loop, self.number = loop, number
        experiment = table.header.experiment
        self.start = experiment.start_time
        self.half = self.start + 0.5 * (experiment.stop_time - self.start)
        self._table, self._new = table, new
        # The row of the table that the first of the steps begins at.
        self._begin = max(new - 1, 0)
        self._groups: dict[tuple[str, ...], np.ndarray] = {}

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s]."""
        return self._table.time[self._new :]

    @property
    def elapsed(self) -> np.ndarray:
        """Times since the start of the run [s]."""
        return self.time - self.start

    @property
    def late(self) -> np.ndarray:
        """Which rows lie in the second half of the run."""
        return self.time >= self.half

    def at(self, *columns: str) -> np.ndarray:
        """Values in the rows."""
        return self._group(columns)[self._new :]

    def starts(self, *columns: str) -> np.ndarray:
        """Values at the beginning of each step that ends at one of the rows."""
        return self._group(columns)[self._begin : -1]

    def ends(self, *columns: str) -> np.ndarray:
        """Values at the end of each of these steps."""
        return self._group(columns)[self._begin + 1 :]

    def acting(self, *columns: str) -> np.ndarray:
        """Values that act in each of these steps, or follow from inputs of its beginning."""
        return self._group(columns)[self._table.acting][self._begin :]

    @cached_property
    def _applied(self) -> np.ndarray:
        return applied(self._table, self.loop)

    def _group(self, columns: tuple[str, ...]) -> np.ndarray:
        if columns not in self._groups:
            self._groups[columns] = self._table.group(*columns)
        return self._groups[columns]

    def errors(self, wanted: np.ndarray | slice = slice(None)) -> np.ndarray:
        """y - y_d with the true control point, in all rows or in some [m]."""
        rows = self._table.rows[self._new :][wanted]
        return tracking_error(Table.of(self._table.header, rows), self.loop)

    @cached_property
    def distance(self) -> np.ndarray:
        """|y - y_d| in each row [m]."""
        # The control point takes as long as everything else together, and is not always wanted.
        return size(self.errors())

    def late_distance(self) -> np.ndarray:
        """|y - y_d| in the rows of the second half [m]."""
        return self.distance[self.late] if self.late.any() else np.empty(0)

    def energy(self) -> np.ndarray:
        """Integral of the square of the applied signal, over each step."""
        h: np.ndarray = self.ends("time") - self.starts("time")
        energy: np.ndarray = self._applied[self._begin :] ** 2 * h
        return energy

    def outside(self) -> np.ndarray:
        """1 for each step whose command is outside the limits, else 0."""
        commanded = self.acting(*self.loop.commanded)
        lower, upper = limits(self._table, self.loop)
        outside: np.ndarray = ((commanded < lower) | (commanded > upper)).astype(float)
        return outside

    def change(self) -> np.ndarray:
        """How far the applied signal moves from step to step."""
        # Before the first step nothing was applied.
        change: np.ndarray = np.abs(np.diff(self._applied, axis=0, prepend=self._applied[:1]))
        return change[self._begin :]

    def miss(self) -> np.ndarray:
        """Squares of dy_hat - dy at the beginning of each step in the second half."""
        late = self.starts("time")[:, 0] >= self.half
        miss: np.ndarray = (self.acting(*self.loop.dy_hat) - self.starts(*self.loop.dy))[late] ** 2
        return miss

    def late_estimates(self) -> np.ndarray:
        """theta_hat in each step that ends in the second half."""
        late = self.ends("time")[:, 0] >= self.half
        estimates: np.ndarray = self.acting(*self.loop.theta_hat)[late]
        return estimates


#: Many terms to one, column by column. A sum goes row by row: it does not depend on the blocks in
#: which rows come.
total, largest = partial(np.sum, axis=0), partial(np.max, axis=0)
first, last = itemgetter(0), itemgetter(-1)


class Fold:
    """Makes an index of terms, a row for each instant or step that counts."""

    def __init__(
        self, term: Callable[[LoopRows], np.ndarray], fold: Callable[[np.ndarray], np.ndarray]
    ) -> None:
        """Start with nothing.

        Args:
            term: of some rows, in their order.
            fold: many terms to one: `total`, `largest`, `first` or `last`.

        """
        self._term, self._fold = term, fold
        self._found, self.n = np.empty(0), 0

    def take(self, rows: LoopRows) -> None:
        """Take some rows into account."""
        if self.n and self._fold is first:
            return
        if len(terms := self._term(rows)):
            terms = terms.reshape(len(terms), -1)
            self._found = self._fold(np.vstack((self._found, terms)) if self.n else terms)
            self.n += len(terms)

    def found(self, end: float) -> np.ndarray:
        """What the terms of a run come to that ends at a time [s]."""
        return self._found


class LargestOfTheEnd:
    """e_f of section 4.2: max |e| of each axis over the last T_L seconds.

    Attributes:
        n: how many steps there were: before the first nothing has been followed.

    """

    def __init__(self) -> None:
        """Start with nothing."""
        self._recent: deque[LoopRows] = deque()
        self.n = 0

    def take(self, rows: LoopRows) -> None:
        """Keep the last seconds."""
        self.n = rows.number + len(rows.time) - 1
        self._recent.append(rows)
        while self._recent[0].time[-1] < rows.time[-1] - LAST_SECONDS:
            self._recent.popleft()

    def found(self, end: float) -> np.ndarray:
        """The largest errors."""
        errors = [rows.errors(rows.time >= end - LAST_SECONDS) for rows in self._recent]
        found: np.ndarray = largest(np.abs(np.vstack(errors)))
        return found


def size(vectors: np.ndarray) -> np.ndarray:
    """The Euclidean norm of each row, summed in the order of its members."""
    squares = np.zeros(len(vectors))
    for column in vectors.T:
        squares = squares + column * column
    norm: np.ndarray = np.sqrt(squares)
    return norm


def for_distances(loops: Sequence[Loop]) -> Needs:
    """What distances between vehicles follow from."""
    return [column for loop in loops for column in loop.position], ()


def distances(table: Table, loops: Sequence[Loop]) -> dict[tuple[str, str], np.ndarray]:
    """Distance between the centres of mass of each two vehicles, by their names, per row [m]."""
    return {
        (one.name, other.name): size(table.group(*one.position) - table.group(*other.position))
        for one, other in combinations(loops, 2)
    }


def smallest_distances(table: Table, loops: Sequence[Loop]) -> np.ndarray:
    """Distance between the two vehicles that are closest to each other, per row [m]."""
    positions = np.stack([table.group(*loop.position) for loop in loops], axis=1)
    rows = max(1, _AT_ONCE // len(loops))
    blocks = np.split(positions, range(rows, len(table), rows))
    return np.concatenate([_smallest(block) for block in blocks])


def _smallest(positions: np.ndarray) -> np.ndarray:
    """The smallest distance of each row, (rows, vehicles, 3)."""
    squares = np.full(len(positions), np.inf)
    for i in range(1, positions.shape[1]):
        apart = positions[:, i:] - positions[:, :-i]
        squares = np.minimum(squares, (apart**2).sum(axis=2).min(axis=1, initial=np.inf))
    smallest: np.ndarray = np.sqrt(squares)
    return smallest
