"""Which rows and columns are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.master.experiment import ROUNDING
from orchestrator.master.observers.observer import Ending, Header, Observer


class Every:
    """Chooses one of the times that come for each interval."""

    def __init__(self, interval: float) -> None:
        """Start before the first time; the interval is in seconds."""
        self._interval, self._count = interval, -1.0

    def chosen(self, times: np.ndarray) -> np.ndarray:
        """Which of some further times are chosen, as truth values."""
        # The number of whole intervals until a time: where it has grown, that time is chosen.
        counts = np.floor(times / self._interval * (1.0 + ROUNDING))
        grown: np.ndarray = np.diff(counts, prepend=self._count) > 0.0
        self._count = float(counts[-1])
        return grown


def every(interval: float | None, header: Header) -> Every | None:
    """What chooses the times of a run for an interval [s]; None: all are kept."""
    # An interval that is no longer than the step keeps all.
    if interval is None or interval <= header.experiment.step:
        return None
    return Every(interval)


def check_interval(interval: float) -> None:
    """Check before a run that its interval can be kept.

    Raises:
        InputError: it is not positive.

    """
    if not interval > 0.0:
        raise InputError(f"interval {interval:g} s must be positive")


class Selection:
    """An observer that hands on a part of the rows and columns to another."""

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
            check_interval(interval)
        self._interval = interval
        self._last = np.empty((0, 0))

    def begin(self, header: Header) -> None:
        """Find out where the columns are."""
        kept = header.columns if self._columns is None else tuple(self._columns)
        self._every = every(self._interval, header)
        self._places = [0, *(1 + header.columns.index(name) for name in kept)]
        self._observer.begin(replace(header, columns=kept))

    def take(self, rows: np.ndarray) -> None:
        """Hand on what is kept."""
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


def matching(names: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The names that match one of some patterns such as `a.b.*`, in their own order.

    Raises:
        InputError: a pattern matches none.

    """
    for pattern in patterns:
        if not any(matches(name, pattern) for name in names):
            raise InputError(f"no column matches {pattern!r}{did_you_mean(pattern, names)}")
    return [name for name in names if any(matches(name, pattern) for pattern in patterns)]


def matches(name: str, pattern: str) -> bool:
    """Whether a name is the pattern, belongs to the group it names, or fits its wildcards."""
    # Brackets belong to names of arrays, and are no sets of letters here.
    escaped = pattern.replace("[", "[[]")
    is_member = name.startswith((f"{pattern}.", f"{pattern}["))
    return name == pattern or is_member or fnmatchcase(name, escaped)
