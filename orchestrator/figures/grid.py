"""Panels in rows and columns, with their scales and legend."""

from __future__ import annotations

from typing import Any

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
