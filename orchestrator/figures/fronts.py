"""Two values against each other, with the best that can be had of both."""

from __future__ import annotations

from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from orchestrator.figures.style import COLOURS, STYLES
from orchestrator.figures.study_axes import is_logarithmic
from orchestrator.studies.figure_entries import FigureEntry
from orchestrator.figures.grid import legend, paneled, spread
from orchestrator.figures.study_values import Values

_HEIGHT = 4.0


def front(plan: FigureEntry, title: str, runs: Values) -> Figure:
    """Every run a dot; a line through those than which no other is better in both values."""
    figure, [[axes]] = paneled(title, 1, 1, _HEIGHT)
    [x] = plan.x
    for (name, part), colour, style in zip(
        runs.parts(plan.by), cycle(COLOURS), cycle(STYLES), strict=False
    ):
        points = np.column_stack((part[x], part[plan.y]))
        points = points[np.isfinite(points).all(axis=1)]
        axes.plot(*points.T, ".", color=colour, markersize=2, alpha=0.25, rasterized=True)
        line = {"color": colour, "linestyle": style, "label": name, "drawstyle": "steps-post"}
        axes.plot(*best(points).T, **line)
    if is_logarithmic(runs[x]):
        spread(axes.xaxis)
    if is_logarithmic(runs[plan.y]):
        spread(axes.yaxis)
    axes.set(xlabel=runs.label(x), ylabel=runs.label(plan.y))
    legend(figure, axes)
    return figure


def best(points: np.ndarray) -> np.ndarray:
    """The points than which no other is smaller in both coordinates, the Pareto front.

    Args:
        points: (n, 2).

    """
    points = points[np.lexsort(points.T[::-1])]
    lowest = np.minimum.accumulate(np.append(np.inf, points[:, 1]))
    front: np.ndarray = points[points[:, 1] < lowest[:-1]]
    return front
