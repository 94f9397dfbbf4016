"""The rows of a run that are visible in a figure, and the mean of signals that chatter."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from orchestrator.cosim import Ending, Header, Table
from orchestrator.vehicle.signals import STANDARD

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Runs of up to so many rows are kept whole.
_WHOLE = 20_000

#: Least number of divisions of a longer run; there are less than twice as many.
_DIVISIONS = 200

#: A signal chatters if it changes direction at more than this share of its rows.
_TURNS = 0.2

#: Changes below this share of the signal's range do not count.
_NEGLIGIBLE = 1e-3

#: Window of a moving mean, as a share of the run.
_WINDOW = 0.01

#: Returns times and values of a signal, linear in the rows of a table.
Signal = Callable[[Table], tuple[np.ndarray, np.ndarray]]


class _Division(NamedTuple):
    """A part of a run, thinned out.

    Attributes:
        pairs: rows with extremes, and the first and the last row, each with the row before it:
            (n, 2, 1 + columns).
        integral: of the rows over time, linear between them.

    """

    pairs: np.ndarray
    integral: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """The mean row, with the end of the division as its time."""
        start, end = self.pairs[0, 0, 0], self.pairs[-1, 1, 0]
        return np.append(end, self.integral[1:] / (end - start))


class VisibleRows(Table):
    """An observer that keeps the rows that are visible in a figure.

    In each division of the time it keeps the rows with the extremes of the watched signals, which
    are the envelope of noise and chatter, and the row before each of them, so that steps stay
    steps. Neighbouring divisions are merged when there are too many: memory does not grow with the
    length of the run, which need not be known in advance.

    Attributes:
        whole_header: of the run, including columns of texts, which are not kept.
        means: of a longer run, whose kept rows have another mean: a row at the start and, at the
            end of each division, the mean of all signals over it, linear between rows. None: all
            rows are kept.

    """

    def __init__(self, watched: Collection[str] = STANDARD.drawn()) -> None:
        """Start without rows; the extremes of the watched columns will be kept."""
        super().__init__()
        self._watched_names = watched
        self.whole_header = self.header
        self.means: Table | None = None

    def begin(self, header: Header) -> None:
        """Make room for a run that is kept whole."""
        self.whole_header = header
        header = replace(header, columns=header.numeric_columns, types={})
        self._enter(header, np.empty((_WHOLE, 1 + len(header.columns))))
        self._watched = [
            i for i, name in enumerate(header.columns, 1) if name in self._watched_names
        ]
        self.means = None
        self._divisions: list[_Division] = []
        self._last = np.empty((0, 1 + len(header.columns)))
        self._per_division, self._in_last = _WHOLE // _DIVISIONS, 0

    def take(self, rows: np.ndarray) -> None:
        """Keep the visible ones of some rows."""
        # 64-bit integers are drawn as doubles.
        rows = self.whole_header.numeric(rows)
        if self._divisions:
            rows = np.vstack((self._last, rows))
        elif self._n + len(rows) <= _WHOLE:
            super().take(rows)
            return
        else:
            first = self.rows[:1] if self._n else rows[:1]
            rows = np.vstack((first, self.rows, rows))
            self._rows, self._n = rows[:0].copy(), 0
        self._last = rows[-1:].copy()
        pairs = sliding_window_view(rows, 2, axis=0).swapaxes(1, 2)
        while len(pairs):
            room = self._per_division - self._in_last
            self._add(pairs[:room])
            pairs = pairs[room:]

    def end(self, ending: Ending) -> None:
        """Put the rows in order."""
        super().end(ending)
        if self._divisions:
            last = np.stack((self._last, self._last), axis=1)
            pairs = np.concatenate([*(division.pairs for division in self._divisions), last])
            rows = pairs.reshape(-1, pairs.shape[-1])
            _, first = np.unique(rows[:, 0], return_index=True)
            self._rows, self._n = rows[first], len(first)
            means = [self._rows[0], *(division.mean for division in self._divisions)]
            self.means = Table.of(self.header, np.array(means), ending)
            self._divisions = []

    def _add(self, pairs: np.ndarray) -> None:
        """Add pairs of successive rows to the last division, or to a new one."""
        n = len(pairs)
        areas = 0.5 * np.diff(pairs[:, :, 0], axis=1) * pairs.sum(axis=1)
        if self._in_last:
            # Row by row, so that the means do not depend on the sizes of blocks.
            last = self._divisions.pop()
            pairs = np.concatenate((last.pairs, pairs))
            areas = np.vstack((last.integral, areas))
        self._divisions.append(_Division(self._extremes(pairs), areas.sum(axis=0)))
        self._in_last = (self._in_last + n) % self._per_division
        if not self._in_last and len(self._divisions) == 2 * _DIVISIONS:
            halves = zip(self._divisions[::2], self._divisions[1::2], strict=True)
            self._divisions = [
                _Division(
                    self._extremes(np.concatenate((first.pairs, second.pairs))),
                    first.integral + second.integral,
                )
                for first, second in halves
            ]
            self._per_division *= 2

    def _extremes(self, pairs: np.ndarray) -> np.ndarray:
        """Return the first and last pair, and those with a watched extreme in their second row."""
        watched = pairs[:, 1, self._watched]
        places = {0, len(pairs) - 1, *watched.argmin(axis=0), *watched.argmax(axis=0)}
        return pairs[sorted(places)]


def draw_signal(axes: Axes, table: Table, signal: Signal, **line: Any) -> bool:
    """Draw a signal; if it chatters, as a pale band with its mean on top, and return true."""
    time, values = signal(table)
    if not chatters(values):
        axes.plot(time, values, **line)
        return False
    # Below all lines, whichever is drawn first.
    axes.plot(time, values, color=line["color"], linewidth=0.5, alpha=0.35, zorder=1.5)
    if isinstance(table, VisibleRows) and table.means is not None:
        # The kept rows have another mean. Means hold from the end of a division to the next.
        ends, means = signal(table.means)
        time = np.repeat(np.append(table.time[0], ends), 2)[1:-1]
        values = np.repeat(means, 2)
    axes.plot(time, moving_mean(time, values, mean_window(table.time)), **line)
    return True


def mean_window(time: np.ndarray) -> float:
    """Return the window of moving means [s]."""
    return _WINDOW * float(np.ptp(time))


def chatters(values: np.ndarray) -> bool:
    """Return true if a signal changes direction so often that its line would be a smear."""
    steps = np.diff(values)
    steps = steps[np.abs(steps) > _NEGLIGIBLE * np.ptp(values)]
    turns = np.count_nonzero(steps[1:] * steps[:-1] < 0.0)
    return bool(turns > _TURNS * len(values))


def moving_mean(time: np.ndarray, values: np.ndarray, window: float) -> np.ndarray:
    """Return the mean of a signal, linear between rows, over a window [s] around each row.

    The window is cut off at the ends of the run; rows need not be equally spaced.
    """
    steps = np.diff(time)
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)))
    lower = np.maximum(time - 0.5 * window, time[0])
    upper = np.minimum(time + 0.5 * window, time[-1])
    area = np.interp(upper, time, integral) - np.interp(lower, time, integral)
    mean: np.ndarray = area / (upper - lower)
    return mean
