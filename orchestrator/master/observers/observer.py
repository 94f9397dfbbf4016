"""What observers of a run are told, and the blocks of rows in which they are told it.

A row holds, at time t_k, the outputs after the step that ended there, and the inputs that this
step was made with.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from time import monotonic
from typing import Any, NamedTuple, Protocol

import numpy as np

from orchestrator.machine.errors import unforeseen
from orchestrator.master.experiment import Experiment
from orchestrator.master.stepper_types import CBlock
from orchestrator.system.names import PortName
from orchestrator.system.values import StringTable

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
        strings: texts for which numbers stand in the rows, by the columns that have them.
        units: of the columns that have one, as the FMUs write them.

    """

    columns: tuple[str, ...]
    experiment: Experiment
    parameters: Mapping[PortName, Any] = field(default_factory=dict)
    loop: str = field(default="python", compare=False)
    strings: Mapping[str, StringTable] = field(default_factory=dict, compare=False)
    units: Mapping[str, str] = field(default_factory=dict, compare=False)

    def text_places(self) -> list[tuple[int, StringTable]]:
        """Where numbers of texts stand in a row, time first, and whose they are."""
        names = enumerate(self.columns, start=1)
        return [(i, self.strings[name]) for i, name in names if name in self.strings]


class Occurrence(NamedTuple):
    """Something that has happened during a run.

    Attributes:
        time: at which it did [s].
        text: what it was.
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
        signals: to stop that have come meanwhile.
        events: that have happened, in their order.

    """

    failure: str | None = None
    remark: str | None = None
    messages: tuple[str, ...] = ()
    signals: tuple[int, ...] = ()
    events: tuple[Occurrence, ...] = ()


class NotKept(Exception):
    """An observer cannot take rows: the disk is full, or memory is short."""


class Observer(Protocol):
    """Something that takes what a run computes."""

    def begin(self, header: Header) -> None:
        """Prepare for the rows of a run."""

    def take(self, rows: np.ndarray) -> None:
        """Take some rows, time first, (n, 1 + columns); the array is used again afterwards."""

    def end(self, ending: Ending) -> None:
        """Take note that there are no more rows."""


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
    ) -> None:
        """Make room for one block.

        Args:
            width: values in a row, without the time.
            observers: to be told.
            ours: a context that they are told in.

        """
        self._rows = np.empty((_ROWS, 1 + width))
        self._times, self._values = self._rows[:, 0], self._rows[:, 1:]
        self.block = CBlock(self._rows.ctypes.data, _ROWS)
        self.due = monotonic() + _PATIENCE
        self._observers, self._ours = observers, ours

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
        failures: list[Exception] = []
        for observer in self._observers:
            try:
                observer.take(rows)
            except Exception as error:
                failures.append(error)
        if failures:
            raise NotKept(f"stopped at t = {rows[-1, 0]:g} s: {unforeseen(failures[0])}")
