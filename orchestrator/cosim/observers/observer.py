"""Observers of a run: what they are told, in which blocks of rows, a selection, a progress bar.

In feedthrough order a row holds all values of its time t_k; in other orders the outputs after the
step that ended there, and the inputs that this step was made with.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from ctypes import Structure, c_size_t, c_void_p
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import monotonic
from typing import Any, NamedTuple, Protocol

import numpy as np

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.values import Standing, as_float32
from orchestrator.machine.errors import InputError, unforeseen
from orchestrator.machine.lazy import progress_bar

#: Rows in a block, and the longest time until observers are told of them [s].
_ROWS, _PATIENCE = 512, 0.2

#: How long a run takes at least for a progress bar to appear [s].
_BAR_DELAY = 2.0


@dataclass(frozen=True)
class Header:
    """What is known of a run when its first row has been computed.

    Attributes:
        columns: `component.port` of every value in a row, after the time.
        experiment: that is run.
        parameters: of all components, as the FMUs reported them after initialisation.
        loop: which one makes the steps, `python` or `compiled`: the rows are the same.
        standing: what numbers in the rows stand for, by the columns that have them.
        units: of the columns that have one, as the FMUs write them.

    """

    columns: tuple[str, ...]
    experiment: Experiment
    parameters: Mapping[PortName, Any] = field(default_factory=dict)
    loop: str = field(default="python", compare=False)
    standing: Mapping[str, Standing] = field(default_factory=dict, compare=False)
    units: Mapping[str, str] = field(default_factory=dict, compare=False)

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
        texts = {name for name, one in self.standing.items() if one.c_type is None}
        return tuple(name for name in self.columns if name not in texts)

    def places(self) -> list[tuple[int, Standing]]:
        """Where these are in a row, time first, and what their numbers stand for."""
        names = enumerate(self.columns, start=1)
        return [(i, self.standing[name]) for i, name in names if name in self.standing]


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


def every(interval: float | None, header: Header) -> Every | None:
    """What chooses the times of a run for an interval [s]; None: all are kept."""
    # An interval that is no longer than the step keeps all.
    if interval is None or interval <= header.experiment.step:
        return None
    return Every(interval, header.experiment.start_time)


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
        self._every = every(self._interval, header)
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


class Progress:
    """An observer that shows how far a run has come, in simulated seconds, on a terminal."""

    def __init__(self, name: str) -> None:
        """Show the name of the run in front of the bar."""
        self._name = name

    def begin(self, header: Header) -> None:
        """Start the clock."""
        self._start = header.experiment.start_time
        self._bar: Any = progress_bar(
            total=header.experiment.stop_time - header.experiment.start_time,
            desc=self._name,
            unit="s",
            delay=_BAR_DELAY,
            disable=None,
            bar_format="{l_bar}{bar}| {n:.0f}/{total:.0f} s [{elapsed}<{remaining}]",
        )

    def take(self, rows: np.ndarray) -> None:
        """Move on to the time of the last row."""
        self._bar.update(rows[-1, 0] - self._start - self._bar.n)

    def end(self, ending: Ending) -> None:
        """Leave the bar where it is."""
        self._bar.close()
