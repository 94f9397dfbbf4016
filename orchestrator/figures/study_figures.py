"""All figures of a study, drawn into files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from orchestrator.figures.style import save, styled
from orchestrator.figures.bands import bands
from orchestrator.studies.figure_entries import BANDS, FRONT, INFLUENCE, MAPS, FigureEntry
from orchestrator.figures.fronts import front
from orchestrator.figures.influence import influence
from orchestrator.figures.maps import maps
from orchestrator.figures.study_values import Columns, Values
from orchestrator.system.names import file_name

_DRAW: Mapping[str, Callable[[FigureEntry, str, Values], Figure]] = {
    BANDS: bands,
    MAPS: maps,
    FRONT: front,
    INFLUENCE: influence,
}

_FORMATS = ("png", "svg")

#: More lines or panels than this show nothing.
_MOST_PARTS = 12


def figure_files(plans: Sequence[FigureEntry]) -> list[str]:
    """The files that :func:`draw_figures` may write."""
    return [f"{file_name(plan.name)}.{ending}" for plan in plans for ending in _FORMATS]


def draw_figures(
    plans: Sequence[FigureEntry], title: str, columns: Columns, folder: Path
) -> Iterator[str]:
    """Draw the figures of a study, as PNG and SVG.

    Args:
        plans: what is to be drawn.
        title: heading; empty where there is one beside the figures.
        columns: of runs.parquet.
        folder: to write into.

    Yields:
        What was left out, and why.

    """
    for plan in plans:
        runs = Values(columns, plan.labels).where(plan.where)
        values = (*plan.x, *([plan.y] if plan.y else ()), *plan.show)
        lacking = [value for value in values if not np.isfinite(runs[value]).any()]
        if lacking:
            yield f"figure {plan.name} left out: no run has {lacking[0]}"
            continue
        if (parts := len(list(runs.parts(plan.by)))) > _MOST_PARTS:
            yield f"figure {plan.name} left out: by tells {parts} parts of the runs apart"
            continue
        with styled():
            figure = _DRAW[plan.kind](plan, title, runs)
        save(figure, *(folder / f"{file_name(plan.name)}.{ending}" for ending in _FORMATS))
