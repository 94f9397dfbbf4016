"""A value over two others, in colours."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from orchestrator.studies.figures.bins import bins_of, grouped, is_logarithmic
from orchestrator.studies.figures.entries import Plan
from orchestrator.studies.figures.panels import paneled, spread
from orchestrator.studies.figures.runs import VERDICTS, Runs

#: Cells along each axis of runs that are no grid.
_CELLS = 24

#: The colours end where all but this share of the cells do: a few that are far off dim no others.
_FAR = 0.01

#: Colours that stay apart for colour-blind eyes and in print, and that of a cell without runs.
_COLOURS, _EMPTY = "cividis", "lightgrey"

_HEIGHT = 2.4


def maps(plan: Plan, title: str, runs: Runs) -> Figure:
    """Panels for each value that is shown, with one scale of colours, beside and below each other.

    The last column that tells runs apart has its values side by side, the others below each other.
    """
    [x] = plan.x
    across, down = bins_of(runs[x], _CELLS), bins_of(runs[plan.y], _CELLS)
    beside = [name for name, _ in runs.parts(plan.by[-1:])]
    below = list(runs.parts(plan.by[:-1]))
    rows = list(product(plan.show, below))
    figure, panels = paneled(title, len(rows), len(beside), _HEIGHT, sharex=True, sharey=True)
    for i, value in enumerate(plan.show):
        own = panels[i * len(below) : (i + 1) * len(below)]
        cells = {}
        for row, (name, part) in zip(own, below, strict=True):
            for axes, (other, runs_there) in zip(row, part.parts(plan.by[-1:]), strict=False):
                place = down.places(runs_there[plan.y]) * len(across.centres)
                place += across.places(runs_there[x])
                groups = grouped(place, runs_there[value], len(across.centres) * len(down.centres))
                middle = np.mean if value in VERDICTS else np.median
                found = [middle(group) if len(group) else np.nan for group in groups]
                cells[axes] = np.reshape(found, (len(down.centres), len(across.centres)))
                axes.set_title(", ".join(filter(None, (name, other))))
        norm = _norm(np.array(list(cells.values())), value in VERDICTS)
        for axes, shown in cells.items():
            axes.set_facecolor(_EMPTY)
            axes.grid(visible=False)
            image = axes.pcolormesh(
                across.edges, down.edges, shown, norm=norm, cmap=_COLOURS, rasterized=True
            )
            if value in plan.limits and len(down.centres) > 1 < len(across.centres):
                axes.contour(
                    across.centres, down.centres, shown, [plan.limits[value]], colors="white"
                )
        figure.colorbar(image, ax=list(own.flat), label=runs.label(value), extend="both")
    for axes in panels.flat:
        if across.is_logarithmic:
            spread(axes.xaxis)
        if down.is_logarithmic:
            spread(axes.yaxis)
    for axes in panels[-1]:
        axes.set_xlabel(runs.label(x))
    for axes in panels[:, 0]:
        axes.set_ylabel(runs.label(plan.y))
    return figure


def _norm(values: np.ndarray, is_share: bool) -> Any:
    """The scale of the colours."""
    values = values[np.isfinite(values)]
    if is_share or not len(values):
        return Normalize(0.0, 1.0)
    low, high = np.quantile(values, (_FAR, 1.0 - _FAR))
    return (LogNorm if is_logarithmic(values) else Normalize)(low, high)
