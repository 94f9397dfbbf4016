"""A value over another one: medians, and around them the bands in which most runs lie."""

from __future__ import annotations

from itertools import cycle, product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestrator.figures.style import COLOURS, STYLES
from orchestrator.figures.study_axes import Bins, bins_of, grouped, is_logarithmic
from orchestrator.studies.figure_entries import FigureEntry
from orchestrator.figures.grid import legend, paneled, spread
from orchestrator.figures.study_values import VERDICTS, Values

#: Parts of an axis along which runs are counted together.
_BINS = 30

#: The band: between these shares of the runs.
_LOWER, _UPPER = 0.1, 0.9

#: Panels in a row, where there is one x.
_ABREAST = 2

_HEIGHT = 2.3


def bands(plan: FigureEntry, title: str, runs: Values) -> Figure:
    """A row of panels for each value that is shown, a column for each x; runs apart by colours."""
    abreast = len(plan.x) if len(plan.x) > 1 else min(_ABREAST, len(plan.show))
    shown = list(product(plan.show, plan.x))
    share = "row" if len(plan.x) > 1 else False
    figure, panels = paneled(title, -(-len(shown) // abreast), abreast, _HEIGHT, sharey=share)
    parts = list(runs.parts(plan.by))
    for axes, (value, x) in zip(panels.flat, shown, strict=False):
        bins = bins_of(runs[x], _BINS, are_full=True)
        for (name, part), colour, style in zip(parts, cycle(COLOURS), cycle(STYLES), strict=False):
            _draw(axes, bins, part[x], part[value], value in VERDICTS, (name, colour, style))
        if value in plan.limits:
            axes.axhline(plan.limits[value], color="black", linewidth=0.8)
        axes.margins(x=0)
        if bins.is_logarithmic:
            spread(axes.xaxis)
        if is_logarithmic(runs[value]):
            spread(axes.yaxis)
        axes.set_xlabel(runs.label(x))
        if x == plan.x[0]:
            axes.set_title(runs.label(value))
    for axes in panels.flat[len(shown) :]:
        axes.remove()
    legend(figure, panels.flat[0])
    return figure


def _draw(
    axes: Axes,
    bins: Bins,
    x: np.ndarray,
    values: np.ndarray,
    is_share: bool,
    look: tuple[str, str, str],
) -> None:
    """Draw a line; a share needs no band."""
    label, color, linestyle = look
    groups = grouped(bins.places(x), values, len(bins.centres))
    middle = [
        np.nan if not len(group) else group.mean() if is_share else np.median(group)
        for group in groups
    ]
    axes.plot(bins.centres, middle, color=color, linestyle=linestyle, label=label)
    if not is_share:
        ends = [
            np.quantile(group, (_LOWER, _UPPER)) if len(group) else (np.nan, np.nan)
            for group in groups
        ]
        axes.fill_between(bins.centres, *np.transpose(ends), color=color, alpha=0.2, linewidth=0)
