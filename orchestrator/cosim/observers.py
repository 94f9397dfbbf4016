"""Observers of a run: tables in memory, files, selections; and the blocks in which they get rows.

In feedthrough order a row holds all values of its time t_k; in other orders the outputs after the
step that ended then, and the inputs of this step.
"""

from __future__ import annotations

import csv
import os
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
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
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import TYPES, Standing, StringTable
from orchestrator.machine.errors import InputError, did_you_mean, listed, unforeseen
from orchestrator.machine.lazy import ROWS_AT_ONCE, parquet
from orchestrator.machine.operating_system import is_still
from orchestrator.machine.texts import matches

#: Rows in a block, and the longest time for which rows wait [s].
_ROWS, _PATIENCE = 512, 0.2


@dataclass(frozen=True)
class Header:
    """Columns, experiment and parameters of a run, known when its first row has been computed.

    Attributes:
        columns: `component.port` of every value in a row, after the time.
        experiment: of the run.
        parameters: of all components, as the FMUs report them after initialisation.
        loop: that makes the steps, `python` or `compiled`; both make the same rows.
        types: FMI types of the columns that do not hold doubles, each one of `TYPES`.
        units: of the columns that have one, as written by the FMUs.
        strings: texts and large integers that numbers in these columns stand for.

    """

    columns: tuple[str, ...]
    experiment: Experiment
    parameters: Mapping[PortName, Any] = field(default_factory=dict)
    loop: str = field(default="python", compare=False)
    types: Mapping[str, str] = field(default_factory=dict, compare=False)
    units: Mapping[str, str] = field(default_factory=dict, compare=False)
    strings: StringTable = field(default_factory=StringTable, compare=False, repr=False)

    #: Types whose values are not all doubles: texts, and integers of 64 bits.
    TYPES: ClassVar[frozenset[str]] = frozenset(name for name, kind in TYPES.items() if kind.stands)

    @classmethod
    def of(
        cls, system: System, experiment: Experiment, columns: Sequence[PortName], loop: str
    ) -> Header:
        """Make the header of a run without FMUs, with the parameters of its system."""
        parameters = {}
        for component in system.components.values():
            own, starts = system.parameters_of(component.name), component.starts
            for variable in component.having("parameter"):
                value = own.get(variable.name, starts.get(variable.name))
                parameters[PortName(component.name, variable.name)] = variable.shown(value)
        names = tuple(map(str, columns))
        return cls(names, experiment, parameters, loop, units=system.units(columns))

    @cached_property
    def place(self) -> Mapping[str, int]:
        """Index of each column in a row, after the time."""
        return {name: i for i, name in enumerate(self.columns, start=1)}

    @cached_property
    def parameter_names(self) -> frozenset[str]:
        """`component.name` of every parameter."""
        return frozenset(map(str, self.parameters))

    @property
    def numeric_columns(self) -> tuple[str, ...]:
        """The columns that do not hold texts."""
        return tuple(name for name in self.columns if self.types.get(name) != "String")

    @cached_property
    def exact_columns(self) -> tuple[str, ...]:
        """The columns that do not hold doubles."""
        return tuple(name for name in self.columns if name in self.types)

    def values(self, column: str, rows: np.ndarray) -> np.ndarray:
        """Return a column of some rows: texts of a String, integers of 64 bits, else doubles."""
        numbers = rows[:, self.place[column]]
        standing = self._standing.get(column)
        return numbers if standing is None else standing.values(numbers)

    def numeric(self, rows: np.ndarray) -> np.ndarray:
        """Return the numeric columns of some rows, time first, all as doubles."""
        if not self.exact_columns:
            return rows
        doubles = rows[:, [0, *(self.place[name] for name in self.numeric_columns)]]
        for i, name in enumerate(self.numeric_columns, 1):
            if name in self.types:
                doubles[:, i] = self.values(name, rows)
        return doubles

    @property
    def encoders(self) -> dict[str, Callable[[Any], float]]:
        """Functions that turn values, or their texts, into numbers of a row, by column."""
        return {name: standing.number for name, standing in self._standing.items()}

    def every(self, interval: float | None) -> Every | None:
        """Return an object that chooses times for an interval [s]; None: all are kept."""
        # An interval not longer than the step keeps all.
        if interval is None or interval <= self.experiment.step:
            return None
        return Every(interval, self.experiment.start_time)

    @cached_property
    def _standing(self) -> dict[str, Standing]:
        """Decoding of the columns that do not hold doubles."""
        return {name: Standing(self.types[name], self.strings) for name in self.exact_columns}


class Occurrence(NamedTuple):
    """An event of a run that has happened.

    Attributes:
        time: of the event [s].
        text: description of the event.
        label: name in a figure; empty: it has none, as the end of an event.
        event: number of the event among those of the run.

    """

    time: float
    text: str
    label: str = ""
    event: int = 0

    def __str__(self) -> str:
        """Format as one line."""
        label = f" ({self.label})" if self.label and self.label != self.text else ""
        return f"t = {self.time:.12g} s: {self.text}{label}"


@dataclass(frozen=True)
class Ending:
    """The end of a run.

    Attributes:
        failure: reason why it failed, or None.
        remark: reason why it ended early without a failure, or None.
        messages: of the FMUs, with status warning or worse.
        interrupts: numbers of the signals that arrived.
        events: that happened, in their order.

    """

    failure: str | None = None
    remark: str | None = None
    messages: tuple[str, ...] = ()
    interrupts: tuple[int, ...] = ()
    events: tuple[Occurrence, ...] = ()

    def require_success(self, name: str) -> None:
        """Refuse a run that was interrupted or has failed.

        Args:
            name: of the system, for the message.

        Raises:
            InputError: it has failed.
            KeyboardInterrupt: a signal stopped it.

        """
        if self.interrupts:
            raise KeyboardInterrupt
        if self.failure is not None:
            raise InputError(f"{name} {self.failure}")


class NotKept(Exception):
    """An observer cannot keep rows: the disk is full, or memory is short."""


class Observer(Protocol):
    """Takes the rows of a run."""

    def begin(self, header: Header) -> None:
        """Prepare for the rows of a run."""

    def take(self, rows: np.ndarray) -> None:
        """Take some rows, time first, (n, 1 + columns); the array is reused afterwards."""

    def end(self, ending: Ending) -> None:
        """Finish: no rows follow."""


class CBlock(Structure):
    """A block of rows, each with the time in front: address, capacity, length: see stepper.c."""

    _fields_ = (("rows", c_void_p), ("most", c_size_t), ("n", c_size_t))


class Blocks:
    """Hands rows to observers in blocks.

    Attributes:
        block: rows that observers have not got yet, as the compiled loop fills them.
        due: time on the clock `monotonic` at which rows must be handed over [s].

    """

    def __init__(
        self,
        width: int,
        observers: Sequence[Observer],
        ours: Callable[[], AbstractContextManager[None]],
        arrange: Callable[[np.ndarray], None],
    ) -> None:
        """Make room for one block.

        Args:
            width: number of values in a row, without the time.
            observers: take the rows.
            ours: context in which observers are called.
            arrange: turns the values of some rows into those of a table, in place.

        """
        self._rows = np.empty((_ROWS, 1 + width))
        self._times, self._values = self._rows[:, 0], self._rows[:, 1:]
        self.block = CBlock(self._rows.ctypes.data, _ROWS)
        self.due = monotonic() + _PATIENCE
        self._told = 0
        self._observers, self._ours, self._arrange = observers, ours, arrange

    @property
    def count(self) -> int:
        """Number of rows until now, handed over or not."""
        return self._told + int(self.block.n)

    def restart(self, count: int) -> None:
        """Hand over all rows, and count from another number on."""
        self.hand_over()
        self._told = count

    def append(self, t: float, values: np.ndarray) -> None:
        """Append a row."""
        n = self.block.n
        if n == _ROWS:
            self.hand_over()
            n = 0
        self._times[n] = t
        self._values[n] = values
        self.block.n = n + 1

    def hand_over(self) -> None:
        """Give the observers the rows of the block.

        Raises:
            NotKept: an observer failed; the others got the rows.

        """
        if n := self.block.n:
            # Counted before observers get them: an observer that fails gets no row twice.
            self.block.n = 0
            self._arrange(self._values[:n])
            with self._ours():
                self._tell(self._rows[:n])
        self.due = monotonic() + _PATIENCE

    def tell(self, rows: np.ndarray) -> None:
        """Give the observers rows that an earlier process has computed.

        Raises:
            NotKept: an observer failed; the others got the rows.

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
    """Chooses the first time in each interval since the start of a run."""

    def __init__(self, interval: float, start: float = 0.0) -> None:
        """Take the interval and the start [s]."""
        self._interval, self._start, self._count = interval, start, -1.0

    def chosen(self, times: np.ndarray) -> np.ndarray:
        """Return which of some further times are chosen, as Booleans."""
        # The rounding of a time depends on its size, not on the length of the run.
        elapsed = times - self._start + np.spacing(np.abs(times))
        counts = np.floor(elapsed / self._interval * (1.0 + Experiment.ROUNDING))
        grown: np.ndarray = np.diff(counts, prepend=self._count) > 0.0
        self._count = float(counts[-1])
        return grown


class Selection:
    """An observer that passes a part of the rows and columns to another one."""

    @staticmethod
    def check(interval: float) -> None:
        """Check an interval before a run.

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
            observer: takes the selected rows.
            interval: of the rows to keep [s], besides the last one; None: all.
            columns: to keep; None: all.

        """
        self._observer, self._columns = observer, columns
        if interval is not None:
            self.check(interval)
        self._interval = interval
        self._last = np.empty((0, 0))

    def begin(self, header: Header) -> None:
        """Find the columns."""
        columns = header.columns if self._columns is None else tuple(self._columns)
        self._every = header.every(self._interval)
        self._places = [0, *(header.place[name] for name in columns)]
        self._observer.begin(replace(header, columns=columns))

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
        """Pass on the last row, if it was not kept."""
        if len(self._last):
            self._observer.take(self._last)
        self._observer.end(ending)


#: Characters between the names of a group and of its members.
_MARKS = re.compile(r"[.\[]")

#: Largest number of rows in memory.
MOST_ROWS = 10_000_000

#: Rows whose distance exceeds the step by more than this share do not follow each other.
_ROUNDING = 1e-6


class Table:
    """An observer that keeps the rows of a run, one at the start and one a step.

    Values that act in a step stand in the row of its beginning or in the row of its end, see
    :attr:`.Experiment.acting_row`. :meth:`step_values`, :meth:`start_values` and :attr:`step_start`
    pair them with the other columns at the beginning of the step.

    Attributes:
        header: of the run: columns, experiment, parameters.
        ending: of the run.

    """

    def __init__(self) -> None:
        """Start without rows."""
        self.header = Header((), Experiment(1.0, 1.0))
        self.ending = Ending()
        self._rows = np.empty((0, 1))
        self._n = 0

    @classmethod
    def of(cls, header: Header, rows: np.ndarray, ending: Ending | None = None) -> Table:
        """Make a table of existing rows, time first."""
        table = cls()
        table.hold(header, rows, ending)
        return table

    def hold(self, header: Header, rows: np.ndarray, ending: Ending | None = None) -> None:
        """Take existing rows, time first."""
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
        # Memory is used when a row is written: a run takes no more than its computed rows.
        try:
            self._enter(header, np.empty((n, 1 + len(header.columns))))
        except MemoryError as error:
            raise InputError(f"a table of {n:,} rows does not fit into memory") from error

    def take(self, rows: np.ndarray) -> None:
        """Keep some rows."""
        self._rows[self._n : self._n + len(rows)] = rows
        self._n += len(rows)

    def end(self, ending: Ending) -> None:
        """Keep the ending."""
        self.ending = ending

    def __getstate__(self) -> dict[str, Any]:
        """Return the state with the rows that were taken, without the room for others."""
        return {**self.__dict__, "_rows": self.rows}

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._n

    def __contains__(self, name: object) -> bool:
        """Return True for a column, for `time`, and for a group or pattern of columns."""
        return name == "time" or name in self.header.place or bool(self._members(name))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the columns, without the time."""
        return iter(self.columns)

    def keys(self) -> tuple[str, ...]:
        """Return the names of the columns, without the time."""
        return self.columns

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column: texts of a String, integers of 64 bits, else doubles.

        The name of a group, such as `arm.joint`, or a pattern, such as `arm.joint[*]`, gives its
        columns side by side, in their order: (rows, columns).

        Raises:
            KeyError: there is no such column or group; the text has a suggestion.

        """
        if name == "time":
            return self.time
        if name in self.header.place:
            return self.header.values(name, self.rows)
        if members := self._members(name):
            return self.group(*members)
        hint = did_you_mean(str(name), (*self.columns, *self._groups))
        raise KeyError(f"no column or group {name!r}{hint}")

    def _members(self, name: object) -> list[str]:
        """Return the columns of a group or pattern; none: there is no such group."""
        if not isinstance(name, str):
            return []
        return [column for column in self.columns if matches(column, name)]

    @property
    def _groups(self) -> list[str]:
        """The names of all groups."""
        names = (name[: mark.start()] for name in self.columns for mark in _MARKS.finditer(name))
        return [*dict.fromkeys(names)]

    def _ipython_key_completions_(self) -> list[str]:
        return ["time", *self.columns, *self._groups]

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
    def units(self) -> dict[str, str]:
        """Units of the time and of all columns, as the FMUs write them; empty without a unit."""
        return {"time": "s"} | {name: self.header.units.get(name, "") for name in self.columns}

    @property
    def parameters(self) -> Mapping[PortName, Any]:
        """Parameters of all components, as the FMUs report them after initialisation."""
        return self.header.parameters

    @property
    def failure(self) -> str | None:
        """Reason why the run failed, or None."""
        return self.ending.failure

    def group(self, *columns: str) -> np.ndarray:
        """Return several columns, groups or patterns side by side, (rows, columns).

        Raises:
            InputError: some are texts and others numbers.

        """
        values = [self[column] for column in columns]
        if len({each.dtype.kind == "U" for each in values}) > 1:
            raise InputError(f"{listed(columns)}: are texts and numbers; take them one by one")
        return np.column_stack(values)

    def missing(self, columns: Iterable[str], parameters: Iterable[str] = ()) -> list[str]:
        """Return the columns and parameters, `component.name`, that the table lacks."""
        known = self.header.parameter_names
        place = self.header.place
        return [column for column in columns if column != "time" and column not in place] + [
            name for name in parameters if name not in known
        ]

    @cached_property
    def _before(self) -> np.ndarray:
        """For every step of :meth:`step_values`, the row of its beginning.

        Where rows were left out and values act in the row of the end, that row.
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
        """Rows in which the values that act in steps stand: all but one."""
        first = self.header.experiment.acting_row
        return slice(first, self._n - 1 + first)

    def step_values(self, *columns: str) -> np.ndarray:
        """Return values that act in steps, or follow from inputs of their beginning."""
        return self.group(*columns)[self.acting]

    def start_values(self, *columns: str) -> np.ndarray:
        """Return the columns at the beginning of these steps."""
        values: np.ndarray = self.group(*columns)[self._before]
        return values


#: Upper limits for Parquet: bytes of a value, and bytes that describe a column of the rows that are
#: written at once.
_BYTES, _CHUNK_BYTES = 9, 1024


class _Output(RawIOBase):
    """A new file for output, which is reopened if an FMU in this process has closed it."""

    def __init__(self, path: Path) -> None:
        """Create the file."""
        self._path, self._at = path, 0
        self._descriptor = self._opened(os.O_CREAT | os.O_TRUNC)
        self._status = os.fstat(self._descriptor)

    def check_place(self) -> None:
        """Check that the file is still where it was created.

        Raises:
            OSError: it was moved or deleted.

        """
        try:
            is_there = os.path.samestat(self._path.stat(), self._status)
        except FileNotFoundError:
            is_there = False
        if not is_there:
            raise FileNotFoundError(f"{self._path} was moved or deleted while it was written")

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._descriptor

    def writable(self) -> bool:
        """Return True."""
        return True

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._at

    def write(self, content: Any) -> int:
        """Write some bytes, and return their number."""
        self._reopen()
        os.lseek(self._descriptor, self._at, os.SEEK_SET)
        n = os.write(self._descriptor, content)
        self._at += n
        return n

    def truncate(self, size: int | None = None) -> int:
        """Truncate the file."""
        self._at = self._at if size is None else size
        self._reopen()
        os.ftruncate(self._descriptor, self._at)
        return self._at

    def close(self) -> None:
        """Close the file if it is open."""
        if not self.closed:
            super().close()
            if is_still(self._descriptor, self._status):
                os.close(self._descriptor)

    def _reopen(self) -> None:
        """Reopen the file if an FMU has closed it, or owns its descriptor now."""
        if not is_still(self._descriptor, self._status):
            self._descriptor = self._opened()

    def _opened(self, flags: int = 0) -> int:
        return os.open(self._path, os.O_WRONLY | getattr(os, "O_BINARY", 0) | flags, 0o666)


class TableFile(ABC):
    """An observer that writes the rows of a run into a file."""

    #: Formats, and the endings of their files.
    Format = Literal["csv", "parquet"]
    FORMATS: ClassVar[tuple[Format, ...]] = get_args(Format)

    def __init__(self, path: Path) -> None:
        """Write into a file, which is made when the run begins."""
        self._path = path

    @staticmethod
    def at(path: Path) -> TableFile:
        """Return the observer for a file: Parquet for `.parquet`, else CSV.

        Raises:
            InputError: Parquet needs pyarrow, which is not installed.

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
    """An observer that writes CSV; the file ends with a whole line even where writing fails."""

    def begin(self, header: Header) -> None:
        """Make the file and write the names of its columns."""
        self._header = header
        self._file = _Output(self._path)
        self._write([("time", *header.columns)])

    def take(self, rows: np.ndarray) -> None:
        """Write some rows, with numbers that read back exactly.

        Raises:
            OSError: some rows could not be written; the others are in the file.

        """
        lines = rows.tolist()
        for name in self._header.exact_columns:
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
            # Readers take an unquoted carriage return for the end of a line, and Python does not
            # quote it.
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

    A file without its last part cannot be read at all: room for that part, and for the rows that
    wait, is always reserved.
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
        for name in header.exact_columns:
            fmi_type = header.types[name]
            kinds[header.place[name]] = getattr(self._arrow, fmi_type.lower())()
        self._schema = self._arrow.schema(list(zip(("time", *header.columns), kinds, strict=True)))
        self._output = _Output(self._path)
        self._file = BufferedWriter(self._output)
        self._writer = self._parquet.ParquetWriter(self._file, self._schema)
        self._waiting = [np.empty((0, len(self._schema)))]
        self._n, self._room = 0, min(header.experiment.rows, ROWS_AT_ONCE)
        self._take_room()

    def take(self, rows: np.ndarray) -> None:
        """Write some rows once there are enough for a block of fixed size."""
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
        for name in self._header.exact_columns:
            place, values = self._header.place[name], self._header.values(name, rows)
            columns[place] = self._arrow.array(values, self._schema.types[place])
        self._writer.write_batch(self._arrow.record_batch(columns, schema=self._schema))
        self._n += 1

    def _take_room(self) -> None:
        """Reserve the room that the file needs until the next block, if possible.

        Raises:
            OSError: there is not enough.

        """
        self._output.check_place()
        self._file.flush()
        if hasattr(os, "posix_fallocate"):
            columns = len(self._schema)
            needed = columns * (self._room * _BYTES + (self._n + 2) * _CHUNK_BYTES)
            os.posix_fallocate(self._file.fileno(), self._file.tell(), needed)
