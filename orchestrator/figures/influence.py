"""Rank correlations: what moves what."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from orchestrator.studies.figure_entries import FigureEntry
from orchestrator.figures.grid import paneled
from orchestrator.figures.study_values import Values

#: Blue falls, red grows: apart for colour-blind eyes.
_COLOURS = "RdBu_r"

#: Numbers are white upon colours as dark as from here on.
_DARK = 0.6

#: Smaller correlations are not printed.
_NOTHING = 0.05

#: Of a row of the matrix, and of what surrounds it [in].
_HEIGHT, _AROUND = 0.27, 0.5


def influence(plan: FigureEntry, title: str, runs: Values) -> Figure:
    """A matrix for each part of the runs: a row for each value, a column for what moves it.

    The colour is Spearman's rank correlation: 1 where more of the one always goes with more of the
    other, -1 where it goes with less, 0 where it makes no difference.
    """
    parts = list(runs.parts(plan.by))
    height = _HEIGHT * len(plan.show) + _AROUND
    figure, panels = paneled(title, len(parts), 1, height, sharex=True)
    for axes, (name, part) in zip(panels.flat, parts, strict=True):
        found = np.array([[_correlation(part[x], part[y]) for x in plan.x] for y in plan.show])
        image = axes.imshow(found, cmap=_COLOURS, vmin=-1.0, vmax=1.0, aspect="auto")
        for (row, column), value in np.ndenumerate(found):
            if abs(value) >= _NOTHING:
                colour = "white" if abs(value) > _DARK else "black"
                axes.text(
                    column, row, f"{value:.2f}".replace("0.", "."), color=colour, fontsize="small",
                    ha="center", va="center",
                )  # fmt: skip
        axes.set_yticks(range(len(plan.show)), [runs.name(value) for value in plan.show])
        axes.set_xticks(range(len(plan.x)), [runs.name(value) for value in plan.x], rotation=90)
        axes.grid(visible=False)
        axes.set_title(name)
    figure.colorbar(image, ax=list(panels.flat), label="rank correlation")
    return figure


def _correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Spearman's rank correlation of the runs that have both values; nan if one is constant."""
    from scipy.stats import spearmanr  # noqa: PLC0415

    both = np.isfinite(x) & np.isfinite(y)
    if min(len(np.unique(x[both])), len(np.unique(y[both]))) < 2:
        return np.nan
    return float(spearmanr(x[both], y[both]).statistic)
