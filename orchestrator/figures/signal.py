"""A signal over time: a line, or, where it is noise or chatter, its mean over a band."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from orchestrator.figures.visible import VisibleRows
from orchestrator.master.observers.table import Table

#: A signal chatters if it turns around at more than this share of its rows ...
_TURNS = 0.2

#: ... by more than this share of its range.
_NEGLIGIBLE = 1e-3

#: A mean is taken over this share of a run.
_WINDOW = 0.01


#: Times and values of a signal, linear in the rows of the table that it is taken from.
Signal = Callable[[Table], tuple[np.ndarray, np.ndarray]]


def draw_signal(axes: Axes, table: Table, signal: Signal, **line: Any) -> bool:
    """A line; of a signal that chatters a pale one, and its mean upon it.

    Returns:
        Whether there is a mean.

    """
    time, values = signal(table)
    if not chatters(values):
        axes.plot(time, values, **line)
        return False
    # Below all lines, whichever is drawn first.
    axes.plot(time, values, color=line["color"], linewidth=0.5, alpha=0.35, zorder=1.5)
    if isinstance(table, VisibleRows) and table.means is not None:
        # Extremes have another mean; means hold from the end of a division to the end of the next.
        ends, means = signal(table.means)
        time = np.repeat(np.append(table.time[0], ends), 2)[1:-1]
        values = np.repeat(means, 2)
    axes.plot(time, moving_mean(time, values, mean_window(table.time)), **line)
    return True


def mean_window(time: np.ndarray) -> float:
    """How long the means are taken over [s]."""
    return _WINDOW * float(np.ptp(time))


def chatters(values: np.ndarray) -> bool:
    """Whether a signal turns around so often that its line would be a smear."""
    steps = np.diff(values)
    steps = steps[np.abs(steps) > _NEGLIGIBLE * np.ptp(values)]
    turns = np.count_nonzero(steps[1:] * steps[:-1] < 0.0)
    return bool(turns > _TURNS * len(values))


def moving_mean(time: np.ndarray, values: np.ndarray, window: float) -> np.ndarray:
    """Mean of a signal, linear between its rows, over a window around each of its times [s].

    Rows need not be equally far apart; at the ends of the run the window is cut off.
    """
    steps = np.diff(time)
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * steps)))
    lower = np.maximum(time - 0.5 * window, time[0])
    upper = np.minimum(time + 0.5 * window, time[-1])
    area = np.interp(upper, time, integral) - np.interp(lower, time, integral)
    mean: np.ndarray = area / (upper - lower)
    return mean
