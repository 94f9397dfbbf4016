"""Observers of a run: what they are told, in which blocks of rows, a selection, a progress bar.

In feedthrough order a row holds all values of its time t_k; in other orders the outputs after the
step that ended there, and the inputs that this step was made with.
"""

from __future__ import annotations

import csv
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from ctypes import Structure, c_size_t, c_void_p
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from io import BufferedWriter, RawIOBase, StringIO
from pathlib import Path
from time import monotonic
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, get_args

import numpy as np

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.variables import TYPES, Standing, StringTable, as_float32
from orchestrator.machine.errors import InputError, did_you_mean, unforeseen
from orchestrator.machine.operating_system import is_still
from orchestrator.machine.parquet import ROWS_AT_ONCE, parquet

#: Rows in a block, and the longest time until observers are told of them [s].
_ROWS, _PATIENCE = 512, 0.2


@dataclass(frozen=True)
class Header:
    """What is known of a run when its first row has been computed.

    Attributes:
        columns: `component.port` of every value in a row, after the time.
        experiment: that is run.
        parameters: of all components, as the FMUs reported them after initialisation.
        loop: which one makes the steps, `python` or `compiled`: the rows are the same.
        types: FMI types of the columns that do not hold doubles, all of them in `TYPES`.
        units: of the columns that have one, as the FMUs write them.
        strings: the texts and large integers that numbers in these columns stand for.

    """

    columns: tuple[str, ...]
    experiment: Experiment
    parameters: Mapping[PortName, Any] = field(default_factory=dict)
    loop: str = field(default="python", compare=False)
    types: Mapping[str, str] = field(default_factory=dict, compare=False)
    units: Mapping[str, str] = field(default_factory=dict, compare=False)
    strings: StringTable = field(default_factory=StringTable, compare=False, repr=False)

    #: Types whose values are not all doubles: texts, and integers of 64 bits.
    TYPES: ClassVar[frozenset[str]] = frozenset(name for name, of in TYPES.items() if of.stands)

    @cached_property
    def place(self) -> Mapping[str, int]:
        """Where each column is in a row, time first."""
        return {name: i for i, name in enumerate(self.columns, start=1)}

    @cached_property
    def parameter_names(self) -> frozenset[str]:
        """`component.name` of every parameter."""
        return frozenset(map(str, self.parameters))

    @property
    def numeric_columns(self) -> tuple[str, ...]:
        """The columns that do not hold texts."""
        return tuple(name for name in self.columns if self.types.get(name) != "String")

    def values(self, column: str, rows: np.ndarray) -> np.ndarray:
        """Return a column of some rows: texts of a String, integers of 64 bits, else doubles."""
        numbers = rows[:, self.place[column]]
        standing = self.standing.get(column)
        return numbers if standing is None else standing.values(numbers)

    def numeric(self, rows: np.ndarray) -> np.ndarray:
        """Return the numeric columns of some rows, time first, all as doubles."""
        if not self.standing:
            return rows
        found = rows[:, [0, *(self.place[name] for name in self.numeric_columns)]]
        for i, name in enumerate(self.numeric_columns, 1):
            if name in self.standing:
                found[:, i] = self.values(name, rows)
        return found

    @property
    def encoders(self) -> dict[str, Callable[[Any], float]]:
        """Functions that put values, or texts of them, into rows, by the columns that need one."""
        return {name: standing.number for name, standing in self.standing.items()}

    def every(self, interval: float | None) -> Every | None:
        """Return what chooses the times of the run for an interval [s]; None: all are kept."""
        # An interval that is no longer than the step keeps all.
        if interval is None or interval <= self.experiment.step:
            return None
        return Every(interval, self.experiment.start_time)

    @cached_property
    def standing(self) -> dict[str, Standing]:
        """What numbers in the rows stand for, by the columns that need it."""
        return {
            name: Standing(self.types[name], self.strings)
            for name in self.columns
            if name in self.types
        }


class Occurrence(NamedTuple):
    """Something that has happened during a run.

    Attributes:
        time: at which it did [s].
        text: what happened.
        label: its name in a figure; empty: it has none, as the end of something.
        event: its number among those that may happen.

    """

    time: float
    text: str
    label: str = ""
    event: int = 0

    def __str__(self) -> str:
        """In one line."""
        label = f" ({self.label})" if self.label and self.label != self.text else ""
        return f"t = {self.time:.12g} s: {self.text}{label}"


@dataclass(frozen=True)
class Ending:
    """How a run has ended.

    Attributes:
        failure: why it failed, or None.
        remark: why it ended early though it has not failed, or None.
        messages: what the FMUs logged with status warning or worse.
        interrupts: numbers of the signals to stop that have come meanwhile.
        events: that have happened, in their order.

    """

    failure: str | None = None
    remark: str | None = None
    messages: tuple[str, ...] = ()
    interrupts: tuple[int, ...] = ()
    events: tuple[Occurrence, ...] = ()

    def require_success(self, name: str) -> None:
        """Refuse a run that has not come to its end.

        Args:
            name: of the system, for the message.

        Raises:
            InputError: it has failed.
            KeyboardInterrupt: a signal has come to stop it.

        """
        if self.interrupts:
            raise KeyboardInterrupt
        if self.failure is not None:
            raise InputError(f"{name} {self.failure}")


class NotKept(Exception):
    """An observer cannot take rows: the disk is full, or memory is short."""


class Observer(Protocol):
    """Takes the rows that a run computes."""

    def begin(self, header: Header) -> None:
        """Prepare for the rows of a run."""

    def take(self, rows: np.ndarray) -> None:
        """Take some rows, time first, (n, 1 + columns); the array is used again afterwards."""

    def end(self, ending: Ending) -> None:
        """Take note that there are no more rows."""


class CBlock(Structure):
    """Rows, each with the time in front: where, how many at most, and how many: see stepper.c."""

    _fields_ = (("rows", c_void_p), ("most", c_size_t), ("n", c_size_t))


class Blocks:
    """Hands rows to observers, some hundred at a time.

    Attributes:
        block: the rows that observers do not know yet, as the compiled loop fills them.
        due: when they have waited long enough, by the clock `monotonic` [s].

    """

    def __init__(
        self,
        width: int,
        observers: Sequence[Observer],
        ours: Callable[[], AbstractContextManager[None]] = nullcontext,
        rounded: Sequence[int] = (),
    ) -> None:
        """Make room for one block.

        Args:
            width: values in a row, without the time.
            observers: to be told.
            ours: a context that they are told in.
            rounded: places of values that FMUs get as Float32.

        """
        self._rows = np.empty((_ROWS, 1 + width))
        self._times, self._values = self._rows[:, 0], self._rows[:, 1:]
        self.block = CBlock(self._rows.ctypes.data, _ROWS)
        self.due = monotonic() + _PATIENCE
        self._told = 0
        self._observers, self._ours = observers, ours
        self._rounded = list(rounded)

    @property
    def count(self) -> int:
        """How many rows there are by now, told or not."""
        return self._told + int(self.block.n)

    def append(self, t: float, values: np.ndarray) -> None:
        """Take a row."""
        n = self.block.n
        if n == _ROWS:
            self.hand_over()
            n = 0
        self._times[n] = t
        self._values[n] = values
        self.block.n = n + 1

    def hand_over(self) -> None:
        """Tell the observers of the rows that they do not know yet.

        Raises:
            NotKept: one of them failed; the others were told.

        """
        if n := self.block.n:
            # Counted as told before they are told: an observer that fails is not told twice.
            self.block.n = 0
            if self._rounded:
                values = self._values[:n]
                values[:, self._rounded] = as_float32(values[:, self._rounded])
            with self._ours():
                self._tell(self._rows[:n])
        self.due = monotonic() + _PATIENCE

    def tell(self, rows: np.ndarray) -> None:
        """Tell the observers of rows that an earlier process has computed.

        Raises:
            NotKept: one of them failed; the others were told.

        """
        self.hand_over()
        self._tell(rows)

    def _tell(self, rows: np.ndarray) -> None:
        self._told += len(rows)
        failures: list[Exception] = []
        for observer in self._observers:
            try:
                observer.take(rows)
            except Exception as error:
                failures.append(error)
        if failures:
            raise NotKept(f"stopped at t = {rows[-1, 0]:g} s: {unforeseen(failures[0])}")


class Every:
    """Chooses the first of the times in each interval since the start of a run."""

    def __init__(self, interval: float, start: float = 0.0) -> None:
        """Take the interval and the start [s]."""
        self._interval, self._start, self._count = interval, start, -1.0

    def chosen(self, times: np.ndarray) -> np.ndarray:
        """Which of some further times are chosen, as truth values."""
        # A time is rounded to the digits that it has, however short the run.
        elapsed = times - self._start + np.spacing(np.abs(times))
        counts = np.floor(elapsed / self._interval * (1.0 + Experiment.ROUNDING))
        grown: np.ndarray = np.diff(counts, prepend=self._count) > 0.0
        self._count = float(counts[-1])
        return grown


class Selection:
    """An observer that hands on a part of the rows and columns to another."""

    @staticmethod
    def check(interval: float) -> None:
        """Check before a run that its interval can be kept.

        Raises:
            InputError: it is not positive.

        """
        if not interval > 0.0:
            raise InputError(f"interval {interval:g} s must be positive")

    def __init__(
        self,
        observer: Observer,
        interval: float | None = None,
        columns: Sequence[str] | None = None,
    ) -> None:
        """Select for an observer.

        Args:
            observer: to be told of the selected rows.
            interval: a row is kept for each of these [s], and the last one; None: all.
            columns: to keep; None: all.

        """
        self._observer, self._columns = observer, columns
        if interval is not None:
            self.check(interval)
        self._interval = interval
        self._last = np.empty((0, 0))

    def begin(self, header: Header) -> None:
        """Find out where the columns are."""
        kept = header.columns if self._columns is None else tuple(self._columns)
        self._every = header.every(self._interval)
        self._places = [0, *(header.place[name] for name in kept)]
        self._observer.begin(replace(header, columns=kept))

    def take(self, rows: np.ndarray) -> None:
        """Pass on the rows that are kept."""
        if self._columns is not None:
            rows = rows[:, self._places]
        if self._every is None:
            self._observer.take(rows)
            return
        chosen = self._every.chosen(rows[:, 0])
        if chosen.any():
            self._observer.take(rows[chosen])
        self._last = rows[:0] if chosen[-1] else rows[-1:].copy()

    def end(self, ending: Ending) -> None:
        """Hand on the last row, if it has not been."""
        if len(self._last):
            self._observer.take(self._last)
        self._observer.end(ending)


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
        return self.header.values(column, self.rows)

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


#: What Parquet needs at most: bytes of a value, and bytes that describe a column of the rows that
#: are written at once.
_BYTES, _CHUNK_BYTES = 9, 1024


class _Output(RawIOBase):
    """A new file to write to, which is opened again where an FMU in this process has closed it."""

    def __init__(self, path: Path) -> None:
        """Make it."""
        self._path, self._at = path, 0
        self._descriptor = self._opened(os.O_CREAT | os.O_TRUNC)
        self._status = os.fstat(self._descriptor)

    def check_place(self) -> None:
        """Check that it is still where it was made.

        Raises:
            OSError: the output would go nowhere.

        """
        try:
            is_there = os.path.samestat(self._path.stat(), self._status)
        except FileNotFoundError:
            is_there = False
        if not is_there:
            raise FileNotFoundError(f"{self._path} was moved or deleted while it was written")

    def fileno(self) -> int:
        """Its descriptor."""
        return self._descriptor

    def writable(self) -> bool:
        """It is."""
        return True

    def tell(self) -> int:
        """How much was written [bytes]."""
        return self._at

    def write(self, content: Any) -> int:
        """Write some of what there is to write."""
        self._reopen()
        os.lseek(self._descriptor, self._at, os.SEEK_SET)
        n = os.write(self._descriptor, content)
        self._at += n
        return n

    def truncate(self, size: int | None = None) -> int:
        """Cut it off."""
        self._at = self._at if size is None else size
        self._reopen()
        os.ftruncate(self._descriptor, self._at)
        return self._at

    def close(self) -> None:
        """Close it, if that is still to be done."""
        if not self.closed:
            super().close()
            if is_still(self._descriptor, self._status):
                os.close(self._descriptor)

    def _reopen(self) -> None:
        """Open it again if an FMU has closed it, or the owner of a file that an FMU has closed."""
        if not is_still(self._descriptor, self._status):
            self._descriptor = self._opened()

    def _opened(self, flags: int = 0) -> int:
        return os.open(self._path, os.O_WRONLY | getattr(os, "O_BINARY", 0) | flags, 0o666)


class TableFile(ABC):
    """An observer that writes the rows of a run into a file."""

    #: Formats, which are also the endings of the files.
    Format = Literal["csv", "parquet"]
    FORMATS: ClassVar[tuple[Format, ...]] = get_args(Format)

    def __init__(self, path: Path) -> None:
        """Write into a file, which is made when the run begins."""
        self._path = path

    @staticmethod
    def at(path: Path) -> TableFile:
        """Return the observer that writes a file: Parquet by that ending, else CSV.

        Raises:
            InputError: it takes pyarrow, which is not installed.

        """
        return ParquetFile(path) if path.suffix == ".parquet" else CsvFile(path)

    @abstractmethod
    def begin(self, header: Header) -> None:
        """Make the file, with the names of its columns."""

    @abstractmethod
    def take(self, rows: np.ndarray) -> None:
        """Write some rows."""

    @abstractmethod
    def end(self, ending: Ending) -> None:
        """Close the file."""


class CsvFile(TableFile):
    """An observer that writes CSV, whose file ends with a whole line even where writing fails."""

    def begin(self, header: Header) -> None:
        """Make the file and write the names of its columns."""
        self._header = header
        self._file = _Output(self._path)
        self._write([("time", *header.columns)])

    def take(self, rows: np.ndarray) -> None:
        """Write some rows, numbers so that they read back exactly.

        Raises:
            OSError: not all of them could be written; those that could are there.

        """
        lines = rows.tolist()
        for name in self._header.standing:
            place = self._header.place[name]
            for line, value in zip(lines, self._header.values(name, rows).tolist(), strict=True):
                line[place] = value
        self._write(lines)

    def end(self, ending: Ending) -> None:
        """Close the file."""
        self._file.close()

    def _write(self, lines: Sequence[Sequence[object]]) -> None:
        self._file.check_place()
        text = _in_csv(lines)
        if "\r" in text:
            # Readers take one outside quotes for the end of a line, and Python puts it in none.
            text = _in_csv(lines, csv.QUOTE_NONNUMERIC)
        content = text.encode()
        begin, n = self._file.tell(), 0
        try:
            while n < len(content):
                n += self._file.write(memoryview(content)[n:])
        except OSError:
            self._file.truncate(begin + content.rfind(b"\n", 0, n) + 1)
            raise


def _in_csv(lines: Sequence[Sequence[object]], quoting: Any = csv.QUOTE_MINIMAL) -> str:
    text = StringIO(newline="")
    csv.writer(text, lineterminator="\n", quoting=quoting).writerows(lines)
    return text.getvalue()


class ParquetFile(TableFile):
    """An observer that writes Apache Parquet: doubles, texts, and integers of 64 bits.

    Without what is written last, nothing of such a file can be read: there is always room for that,
    and for the rows that wait.
    """

    def __init__(self, path: Path) -> None:
        """Write into a file, which is made when the run begins.

        Raises:
            InputError: pyarrow is not installed.

        """
        super().__init__(path)
        self._parquet = parquet()

    def begin(self, header: Header) -> None:
        """Make the file and its schema."""
        self._arrow: Any = import_module("pyarrow")
        self._header = header
        kinds = [self._arrow.float64()] * (1 + len(header.columns))
        for name, standing in header.standing.items():
            kinds[header.place[name]] = (
                self._arrow.string()
                if standing.c_type is None
                else self._arrow.from_numpy_dtype(np.dtype(standing.c_type))
            )
        self._schema = self._arrow.schema(list(zip(("time", *header.columns), kinds, strict=True)))
        self._output = _Output(self._path)
        self._file = BufferedWriter(self._output)
        self._writer = self._parquet.ParquetWriter(self._file, self._schema)
        self._waiting = [np.empty((0, len(self._schema)))]
        self._n, self._room = 0, min(header.experiment.rows, ROWS_AT_ONCE)
        self._take_room()

    def take(self, rows: np.ndarray) -> None:
        """Write some rows, when there are enough of them: always as many at once."""
        self._waiting.append(rows.copy())
        while sum(map(len, self._waiting)) >= ROWS_AT_ONCE:
            waiting = np.vstack(self._waiting)
            self._waiting = [waiting[ROWS_AT_ONCE:]]
            self._write(waiting[:ROWS_AT_ONCE])
            self._take_room()

    def end(self, ending: Ending) -> None:
        """Write the rest and close the file."""
        self._output.check_place()
        if len(rest := np.vstack(self._waiting)):
            self._write(rest)
        self._writer.close()
        self._file.truncate()
        self._file.close()

    def _write(self, rows: np.ndarray) -> None:
        columns = [self._arrow.array(column) for column in rows.T]
        for name in self._header.standing:
            place, values = self._header.place[name], self._header.values(name, rows)
            columns[place] = self._arrow.array(values, self._schema.types[place])
        self._writer.write_batch(self._arrow.record_batch(columns, schema=self._schema))
        self._n += 1

    def _take_room(self) -> None:
        """Take the room that the file needs until the next time, if it can be had.

        Raises:
            OSError: there is not enough.

        """
        self._output.check_place()
        self._file.flush()
        if hasattr(os, "posix_fallocate"):
            columns = len(self._schema)
            needed = columns * (self._room * _BYTES + (self._n + 2) * _CHUNK_BYTES)
            os.posix_fallocate(self._file.fileno(), self._file.tell(), needed)
