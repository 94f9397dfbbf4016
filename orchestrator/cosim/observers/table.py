"""Rows kept in memory: a table of all ports over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.observers.observer import Ending, Header
from orchestrator.cosim.system.names import PortName
from orchestrator.machine.errors import InputError, did_you_mean

#: More rows than this are not kept in memory.
MOST_ROWS = 10_000_000

#: Rows further apart than the step, by more than this share of it, do not follow each other.
_ROUNDING = 1e-6


class Table:
    """An observer that keeps the rows of a run, one at the start and one a step.

    What acts in a step stands in the row of its beginning or in that of its end, as
    :attr:`.Experiment.acting_row` says. :meth:`step_values`, :meth:`start_values` and
    :attr:`step_start` pair it with what the other columns hold when it begins.

    Attributes:
        header: of the run: columns, experiment, parameters.
        ending: how the run has ended.

    """

    def __init__(self) -> None:
        """Start without rows."""
        self.header = Header((), Experiment(1.0, 1.0))
        self.ending = Ending()
        self._rows = np.empty((0, 1))
        self._n = 0

    @classmethod
    def of(cls, header: Header, rows: np.ndarray, ending: Ending | None = None) -> Table:
        """A table of rows that are there already, time first."""
        table = cls()
        table.hold(header, rows, ending)
        return table

    def hold(self, header: Header, rows: np.ndarray, ending: Ending | None = None) -> None:
        """Take rows that are there already, time first."""
        self._enter(header, rows)
        self._n = len(rows)
        self.ending = ending or self.ending

    def _enter(self, header: Header, rows: np.ndarray) -> None:
        self.header, self._rows = header, rows

    def begin(self, header: Header) -> None:
        """Make room for all rows."""
        n = header.experiment.rows
        if n > MOST_ROWS:
            raise InputError(f"{n:,} rows do not fit into memory; take larger steps")
        # Memory is taken when a row is written, so a long run costs what it has computed.
        try:
            self._enter(header, np.empty((n, 1 + len(header.columns))))
        except MemoryError as error:
            raise InputError(f"a table of {n:,} rows does not fit into memory") from error

    def take(self, rows: np.ndarray) -> None:
        """Keep some rows."""
        self._rows[self._n : self._n + len(rows)] = rows
        self._n += len(rows)

    def end(self, ending: Ending) -> None:
        """Remember how the run has ended."""
        self.ending = ending

    def __len__(self) -> int:
        """How many rows were computed."""
        return self._n

    def __contains__(self, column: str) -> bool:
        """Whether there is a column `component.port`."""
        return column == "time" or column in self.header.place

    def __getitem__(self, column: str) -> np.ndarray:
        """The values of one column: texts of a String, integers of 64 bits, else doubles.

        Raises:
            KeyError: there is no such column; the text has a suggestion.

        """
        if column == "time":
            return self.time
        if column not in self.header.place:
            raise KeyError(f"no column {column!r}{did_you_mean(str(column), self.header.place)}")
        values = self.rows[:, self.header.place[column]]
        standing = self.header.standing.get(column)
        return values if standing is None else standing.values(values)

    @property
    def rows(self) -> np.ndarray:
        """All rows, time first, (rows, 1 + columns)."""
        return self._rows[: self._n]

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s]."""
        return self.rows[:, 0]

    @property
    def columns(self) -> tuple[str, ...]:
        """`component.port` of every column after the time."""
        return self.header.columns

    @property
    def parameters(self) -> Mapping[PortName, Any]:
        """Of all components, as the FMUs reported them after initialisation."""
        return self.header.parameters

    @property
    def failure(self) -> str | None:
        """Why the run ended early, or None."""
        return self.ending.failure

    def group(self, *columns: str) -> np.ndarray:
        """Several columns side by side, (rows, columns)."""
        return np.column_stack([self[column] for column in columns])

    def missing(self, columns: Iterable[str], parameters: Iterable[str] = ()) -> list[str]:
        """The columns and parameters, `component.name`, that are wanted and not there."""
        known = self.header.parameter_names
        return [column for column in columns if column not in self] + [
            name for name in parameters if name not in known
        ]

    @cached_property
    def _before(self) -> np.ndarray:
        """For every step of :meth:`step_values`, the row of the time at which it began.

        Where rows were left out and what acts stands in that of its end, it is that row.
        """
        ends = np.arange(1, self._n)
        follows = np.diff(self.time) <= self.header.experiment.step * (1.0 + _ROUNDING)
        return np.where(follows | (self.header.experiment.acting_row == 0), ends - 1, ends)

    @property
    def step_start(self) -> np.ndarray:
        """Times at which the steps of :meth:`step_values` began [s]."""
        exact = self.time[self._before]
        skipped = self._before == np.arange(1, self._n)
        starts: np.ndarray = np.where(skipped, exact - self.header.experiment.step, exact)
        return starts

    @property
    def acting(self) -> slice:
        """The rows in which what acts in steps stands: all but one."""
        first = self.header.experiment.acting_row
        return slice(first, self._n - 1 + first)

    def step_values(self, *columns: str) -> np.ndarray:
        """What acts in steps, or follows from inputs of their beginning: of each row but one."""
        return self.group(*columns)[self.acting]

    def start_values(self, *columns: str) -> np.ndarray:
        """What these columns held when these steps began."""
        values: np.ndarray = self.group(*columns)[self._before]
        return values
