"""A value over two others, in colours."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from orchestrator.figures.study_axes import Bins, bins_of, grouped, is_logarithmic
from orchestrator.studies.figure_entries import FigureEntry
from orchestrator.figures.grid import paneled, spread
from orchestrator.figures.study_values import VERDICTS, Values

#: Cells along each axis of runs that are no grid.
_CELLS = 24

#: The colours end where all but this share of the cells do: a few that are far off dim no others.
_FAR = 0.01

#: Colours that stay apart for colour-blind eyes and in print, and that of a cell without runs.
_COLOURS, _EMPTY = "cividis", "lightgrey"

_HEIGHT = 2.3


def maps(plan: FigureEntry, title: str, runs: Values) -> Figure:
    """Panels for each value that is shown, with one scale of colours.

    The last column that tells runs apart has its values side by side, the others below each other.
    """
    [x], y = plan.x, plan.y
    across, down = bins_of(runs[x], _CELLS), bins_of(runs[y], _CELLS)
    beside = [name for name, _ in runs.parts(plan.by[-1:])]
    below = list(runs.parts(plan.by[:-1]))
    rows = len(plan.show) * len(below)
    figure, panels = paneled(title, rows, len(beside), _HEIGHT, sharex=True, sharey=True)
    for value, own in zip(plan.show, np.split(panels, len(plan.show)), strict=True):
        drawn: dict[Axes, np.ndarray] = {}
        for row, (name, part) in zip(own, below, strict=True):
            row[0].set_ylabel("\n".join(filter(None, (name, runs.label(y)))))
            for other, cell in part.parts(plan.by[-1:]):
                axes = row[beside.index(other)]
                places = down.places(cell[y]), across.places(cell[x])
                drawn[axes] = _middles(places, cell[value], (down, across), value in VERDICTS)
        norm = _norm(np.array(list(drawn.values())), value in VERDICTS)
        for axes, middles in drawn.items():
            image = axes.pcolormesh(
                across.edges, down.edges, middles, norm=norm, cmap=_COLOURS, rasterized=True
            )
            axes.set_facecolor(_EMPTY)
            axes.grid(visible=False)
            if value in plan.limits and min(middles.shape) > 1:
                edge = [plan.limits[value]]
                axes.contour(across.centres, down.centres, middles, edge, colors="white")
        figure.colorbar(image, ax=list(own.flat), label=runs.label(value), extend="both")
    for axes, name in zip(panels[0], beside, strict=True):
        axes.set_title(name)
    for axes in panels[-1]:
        axes.set_xlabel(runs.label(x))
    # All panels share their axes.
    if across.is_logarithmic:
        spread(axes.xaxis)
    if down.is_logarithmic:
        spread(axes.yaxis)
    return figure


def _middles(
    places: tuple[np.ndarray, np.ndarray],
    values: np.ndarray,
    bins: tuple[Bins, Bins],
    is_verdict: bool,
) -> np.ndarray:
    """The median of each cell, or the share of a verdict; nan where there are no runs."""
    shape = len(bins[0].centres), len(bins[1].centres)
    groups = grouped(np.ravel_multi_index(places, shape), values, shape[0] * shape[1])
    middle = np.mean if is_verdict else np.median
    return np.reshape([middle(group) if len(group) else np.nan for group in groups], shape)


def _norm(values: np.ndarray, is_verdict: bool) -> Any:
    """The scale of the colours."""
    values = values[np.isfinite(values)]
    if is_verdict or not len(values):
        return Normalize(0.0, 1.0)
    low, high = np.quantile(values, (_FAR, 1.0 - _FAR))
    return (LogNorm if is_logarithmic(values) else Normalize)(low, high)
