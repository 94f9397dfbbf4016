"""Axes of the figures of studies: panels in rows and columns, scales, and values in bins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from orchestrator.figures.style import WIDTH, heading

#: Room for a heading, and for a legend or the names of axes [in].
_HEADING, _NAMES = 0.3, 0.45

#: Numbers along a logarithmic axis; with less powers of ten than that, 3 has one as well.
_TICKS, _FEW = 6, 2.5


def paneled(title: str, rows: int, columns: int, height: float, **how: Any) -> tuple[Figure, Any]:
    """A figure with panels.

    Args:
        title: heading; empty for none.
        rows: of panels.
        columns: of panels.
        height: of a row [in].
        how: for matplotlib's subplots.

    Returns:
        The figure, and its axes in rows and columns.

    """
    figure = Figure(figsize=(WIDTH, rows * height + _NAMES + _HEADING * bool(title)))
    if title:
        figure.suptitle(heading(title), wrap=True)
    return figure, figure.subplots(rows, columns, squeeze=False, **how)


def spread(axis: Any) -> None:
    """Make an axis logarithmic, with a few powers of ten along it."""
    [name] = axis.axis_name
    getattr(axis.axes, f"set_{name}scale")("log")
    axis.axes.autoscale_view()
    low, high = axis.get_view_interval()
    is_short = high < low * 10.0**_FEW
    axis.set_major_locator(LogLocator(subs=(1.0, 3.0) if is_short else (1.0,), numticks=_TICKS))
    axis.set_minor_locator(NullLocator())
    if is_short:
        axis.set_major_formatter("{x:g}")


def legend(figure: Figure, axes: Axes) -> None:
    """Say below all panels what the lines of one mean, if it has several."""
    handles, labels = axes.get_legend_handles_labels()
    if len(handles) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=2)


#: Up to so many different values have a bin each.
_GRID = 40

#: An axis is logarithmic if its values are positive, and a large one, larger than this share of
#: them, is so many times a small one.
_LARGE, _WIDE = 0.95, 10.0


@dataclass(frozen=True)
class Bins:
    """The bins of an axis.

    Attributes:
        edges: one more than there are bins.
        centres: of the bins; of a grid, its values.
        is_logarithmic: whether the axis is.

    """

    edges: np.ndarray
    centres: np.ndarray
    is_logarithmic: bool

    def places(self, values: np.ndarray) -> np.ndarray:
        """The number of the bin of each value."""
        places: np.ndarray = np.searchsorted(self.edges[1:-1], values, side="right")
        return places


def is_logarithmic(values: np.ndarray) -> bool:
    """Whether values are spread so far that only a logarithmic axis shows them all."""
    values = values[np.isfinite(values)]
    if not values.size or values.min() <= 0.0:
        return False
    small, large = np.quantile(values, (1.0 - _LARGE, _LARGE))
    return bool(large >= _WIDE * small)


def bins_of(values: np.ndarray, most: int, *, are_full: bool = False) -> Bins:
    """Bins for some values, at least one of which is finite.

    Args:
        values: of a grid, or anywhere.
        most: how many bins there are for values that are no grid.
        are_full: whether these have as many values each, and not the same width.

    """
    values = values[np.isfinite(values)]
    wide = is_logarithmic(values)
    places = np.unique(np.log(values) if wide else values)
    if len(places) > _GRID:
        even = np.linspace(0.0, 1.0, most + 1)
        edges = np.quantile(places, even) if are_full else np.interp(even, (0, 1), places[[0, -1]])
        centres = 0.5 * (edges[1:] + edges[:-1])
    else:
        between = 0.5 * (places[1:] + places[:-1])
        # The outer bins are as wide as they would be with one more neighbour.
        first, last = (between[0], between[-1]) if between.size else (places + 0.5, places - 0.5)
        edges = np.hstack((2.0 * places[0] - first, between, 2.0 * places[-1] - last))
        centres = places
    if wide:
        edges, centres = np.exp(edges), np.exp(centres)
    return Bins(edges, centres, wide)


def grouped(places: np.ndarray, values: np.ndarray, n: int) -> list[np.ndarray]:
    """The finite values of each of n bins.

    Args:
        places: the number of the bin of each value.
        values: to be grouped.
        n: how many bins there are.

    """
    finite = np.isfinite(values)
    places, values = places[finite], values[finite]
    order = np.argsort(places, kind="stable")
    return np.split(values[order], np.searchsorted(places[order], np.arange(1, n)))
