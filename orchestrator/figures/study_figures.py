"""Figures of a study from its runs: a study file says which.

A new one is a function here, which :data:`_DRAW` names, and an entry of :data:`.CHARTS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import cycle, product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from orchestrator.figures.drawing import save, styled
from orchestrator.figures.study_values import (
    VERDICTS,
    Bins,
    Columns,
    FigureEntry,
    Values,
    bins_of,
    grouped,
    is_logarithmic,
)
from orchestrator.figures.style import COLOURS, FIGURE_FORMATS, FIGURE_WIDTH, STYLES, heading
from orchestrator.machine.disk import file_name

#: Heights of a row of panels, of a panel by itself, of a row of a matrix and what surrounds it, and
#: of a bar of colours with its name at least [in].
_ROW, _SQUARE, _LINE, _AROUND, _BAR = 2.3, 4.0, 0.27, 0.5, 1.3

#: Bands: parts of an axis along which runs are counted together, shares of the runs between which
#: the band lies, and panels in a row, where there is one x.
_BINS, _LOWER, _UPPER, _ABREAST = 30, 0.1, 0.9, 2

#: Maps: cells along each axis of runs that do not form a grid; the colours end where all but a
#: share of the cells do, so that a few outliers do not dim the others.
_CELLS, _FAR = 24, 0.01

#: Colours that stay apart for colour-blind eyes and in print, the one of a cell without runs, and
#: the scale of correlations: blue falls, red grows.
_VALUES, _EMPTY, _CORRELATIONS = "cividis", "lightgrey", "RdBu_r"

#: Influence: numbers are white upon colours as dark as from here on; smaller ones are not printed.
_DARK, _NOTHING = 0.6, 0.05

#: More lines or panels than this show nothing.
_MOST_PARTS = 12

#: Room for a heading, and for a legend or the names of axes [in].
_HEADING, _NAMES = 0.3, 0.45

#: Numbers along a logarithmic axis, and powers of ten up to which there are ticks between them;
#: with fewer powers of ten than the last, 3 has a number as well, and below one power 2 and 5.
_TICKS, _SMALL_TICKS, _FEW = 6, 12, 2.5


def make_panels(
    title: str, rows: int, columns: int, height: float, **how: Any
) -> tuple[Figure, Any]:
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
    figure = Figure(figsize=(FIGURE_WIDTH, rows * height + _NAMES + _HEADING * bool(title)))
    if title:
        figure.suptitle(heading(title), wrap=True)
    return figure, figure.subplots(rows, columns, squeeze=False, **how)


def spread(axis: Any, is_wide: bool) -> None:
    """Make an axis logarithmic if its values are wide, with a few powers of ten along it."""
    if not is_wide:
        return
    [name] = axis.axis_name
    getattr(axis.axes, f"set_{name}scale")("log")
    axis.axes.autoscale_view()
    low, high = axis.get_view_interval()
    is_short = high < low * 10.0**_FEW
    subs = (1.0, 2.0, 5.0) if high < 10.0 * low else (1.0, 3.0) if is_short else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=_TICKS))
    axis.set_minor_locator(LogLocator(subs=range(2, 10), numticks=_SMALL_TICKS))
    axis.set_minor_formatter(NullFormatter())
    if is_short:
        axis.set_major_formatter("{x:g}")


def legend(figure: Figure, *more: Artist) -> None:
    """Say below all panels what their lines mean, and what else there is in them.

    Args:
        figure: whose panels have lines with labels.
        more: samples with labels.

    """
    handles = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    handles |= {str(sample.get_label()): sample for sample in more}
    if len(handles) > 1 or more:
        figure.legend(
            handles=list(handles.values()), loc="outside lower center", ncols=min(2, len(handles))
        )


def _sample(colour: str, text: str, alpha: float = 1.0) -> Patch:
    """A sample of a colour for a legend."""
    return Patch(facecolor=colour, alpha=alpha, linewidth=0, label=text)


def bands(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """A row of panels for each value that is shown, a column for each x; runs apart by colours."""
    abreast = len(entry.x) if len(entry.x) > 1 else min(_ABREAST, len(entry.show))
    shown = list(product(entry.show, entry.x))
    sharing = "row" if len(entry.x) > 1 else False
    figure, panels = make_panels(title, -(-len(shown) // abreast), abreast, _ROW, sharey=sharing)
    parts = list(runs.parts(entry.by))
    for axes, (value, x) in zip(panels.flat, shown, strict=False):
        bins = bins_of(runs[x], _BINS, are_full=True, is_wide=entry.logarithmic.get(x))
        for (name, part), colour, style in zip(parts, cycle(COLOURS), cycle(STYLES), strict=False):
            _draw(axes, bins, part[x], part[value], value in VERDICTS, (name, colour, style))
        if value in entry.limits:
            axes.axhline(entry.limits[value], color="black", linewidth=0.8, label="limit")
        axes.margins(x=0)
        spread(axes.xaxis, bins.is_logarithmic)
        spread(axes.yaxis, is_logarithmic(runs[value]))
        axes.set_xlabel(runs.label(x))
        if x == entry.x[0]:
            axes.set_title(runs.label(value))
    for axes in panels.flat[len(shown) :]:
        axes.remove()
    has_bands = any(value not in VERDICTS for value in entry.show)
    share = _UPPER - _LOWER
    legend(
        figure, *[_sample("grey", f"band: {share:.0%} of the runs, line: median", 0.3)] * has_bands
    )
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


def maps(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """Panels for each value that is shown, with one scale of colours.

    The last column that tells runs apart has its values side by side, the others below each other.
    """
    [x], y = entry.x, entry.y
    across, down = (
        bins_of(runs[name], _CELLS, is_wide=entry.logarithmic.get(name)) for name in (x, y)
    )
    beside = [name for name, _ in runs.parts(entry.by[-1:])]
    below = list(runs.parts(entry.by[:-1]))
    rows = len(entry.show) * len(below)
    figure, panels = make_panels(title, rows, len(beside), _ROW, sharex=True, sharey=True)
    has_gaps = False
    for value, own in zip(entry.show, np.split(panels, len(entry.show)), strict=True):
        drawn: dict[Axes, np.ndarray] = {}
        for row, (name, part) in zip(own, below, strict=True):
            row[0].set_ylabel("\n".join(filter(None, (name, runs.label(y)))))
            for other, cell in part.parts(entry.by[-1:]):
                axes = row[beside.index(other)]
                places = down.places(cell[y]), across.places(cell[x])
                drawn[axes] = _cells(places, cell[value], (down, across), value in VERDICTS)
        norm = _norm(np.array(list(drawn.values())), value in VERDICTS)
        for axes, middles in drawn.items():
            image = axes.pcolormesh(
                across.edges, down.edges, middles, norm=norm, cmap=_VALUES, rasterized=True
            )
            axes.set_facecolor(_EMPTY)
            axes.grid(visible=False)
            if value in entry.limits and min(middles.shape) > 1:
                edge = [entry.limits[value]]
                axes.contour(across.centres, down.centres, middles, edge, colors="white")
        label = runs.label(value)
        if value in entry.limits:
            label += f"\n(white line: {entry.limits[value]:g})"
        has_gaps |= bool(np.isnan(list(drawn.values())).any())
        # A share has ends; other colours stop before the farthest values.
        has_ends = (norm.vmin, norm.vmax) == (0.0, 1.0)
        figure.colorbar(
            image, ax=list(own.flat), label=label, extend="neither" if has_ends else "both"
        )
    for axes, name in zip(panels[0], beside, strict=True):
        axes.set_title(name)
    for axes in panels[-1]:
        axes.set_xlabel(runs.label(x))
    # All panels share their axes.
    spread(axes.xaxis, across.is_logarithmic)
    spread(axes.yaxis, down.is_logarithmic)
    legend(figure, *[_sample(_EMPTY, "no run has a value here")] * has_gaps)
    return figure


def _cells(
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


def front(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """Every run a dot; a line through those than which no other is better in both values."""
    figure, [[axes]] = make_panels(title, 1, 1, _SQUARE)
    [x] = entry.x
    for (name, part), colour, style in zip(
        runs.parts(entry.by), cycle(COLOURS), cycle(STYLES), strict=False
    ):
        points = np.column_stack((part[x], part[entry.y]))
        points = points[np.isfinite(points).all(axis=1)]
        axes.plot(*points.T, ".", color=colour, markersize=2, alpha=0.25, rasterized=True)
        line = {"color": colour, "linestyle": style, "label": name, "drawstyle": "steps-post"}
        axes.plot(*pareto_front(points).T, **line)
    spread(axes.xaxis, is_logarithmic(runs[x]))
    spread(axes.yaxis, is_logarithmic(runs[entry.y]))
    axes.set(xlabel=runs.label(x), ylabel=runs.label(entry.y))
    legend(figure)
    return figure


def pareto_front(points: np.ndarray) -> np.ndarray:
    """The points than which no other is smaller in both coordinates, the Pareto front.

    Args:
        points: (n, 2).

    """
    points = points[np.lexsort(points.T[::-1])]
    lowest = np.minimum.accumulate(np.append(np.inf, points[:, 1]))
    front: np.ndarray = points[points[:, 1] < lowest[:-1]]
    return front


def influence(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """A matrix for each part of the runs: a row for each value, a column for what moves it.

    The colour is Spearman's rank correlation: 1 where more of the one always goes with more of the
    other, -1 where it goes with less, 0 where it makes no difference.
    """
    parts = list(runs.parts(entry.by))
    height = max(_LINE * len(entry.show), _BAR / len(parts)) + _AROUND
    figure, panels = make_panels(title, len(parts), 1, height, sharex=True)
    has_gaps = False
    for axes, (name, part) in zip(panels.flat, parts, strict=True):
        found = np.array([[_correlation(part[x], part[y]) for x in entry.x] for y in entry.show])
        image = axes.imshow(found, cmap=_CORRELATIONS, vmin=-1.0, vmax=1.0, aspect="auto")
        for (row, column), value in np.ndenumerate(found):
            if abs(value) >= _NOTHING:
                colour = "white" if abs(value) > _DARK else "black"
                axes.text(
                    column, row, f"{value:.2f}".replace("0.", "."), color=colour, fontsize="small",
                    ha="center", va="center",
                )  # fmt: skip
        axes.set_yticks(range(len(entry.show)), [runs.name(value) for value in entry.show])
        axes.set_xticks(range(len(entry.x)), [runs.name(value) for value in entry.x], rotation=90)
        axes.grid(visible=False)
        axes.set_facecolor(_EMPTY)
        axes.set_title(name)
        has_gaps |= bool(np.isnan(found).any())
    names = max(name.get_window_extent().height for name in axes.get_xticklabels()) / figure.dpi
    figure.set_figheight(figure.get_figheight() + max(0.0, names - _NAMES))
    figure.colorbar(image, ax=list(panels.flat), label="rank correlation")
    legend(figure, *[_sample(_EMPTY, "one of the two is constant")] * has_gaps)
    return figure


def _correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Spearman's rank correlation of the runs that have both values; nan if one is constant."""
    from scipy.stats import spearmanr  # noqa: PLC0415

    both = np.isfinite(x) & np.isfinite(y)
    if min(len(np.unique(x[both])), len(np.unique(y[both]))) < 2:
        return np.nan
    return float(spearmanr(x[both], y[both]).statistic)


#: What draws each chart.
_DRAW: Mapping[str, Callable[[FigureEntry, str, Values], Figure]] = {
    "bands": bands,
    "maps": maps,
    "front": front,
    "influence": influence,
}


def figure_files(entries: Sequence[FigureEntry]) -> list[str]:
    """The files that :func:`draw_figures` may write."""
    return [f"{file_name(entry.name)}.{ending}" for entry in entries for ending in FIGURE_FORMATS]


def draw_figures(
    entries: Sequence[FigureEntry],
    title: str,
    columns: Columns,
    folder: Path,
    legends: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    logarithmic: Mapping[str, bool] | None = None,
) -> Iterator[str]:
    """Draw the figures of a study, as PNG and SVG.

    Args:
        entries: the figures to draw.
        title: heading; empty where there is one beside the figures.
        columns: of runs.parquet.
        folder: to write into.
        legends: what the lines of scenarios are called.
        units: of parameters, as FMUs write them.
        logarithmic: whether the axes of values that are sampled are.

    Yields:
        What was left out, and why.

    """
    for entry in [replace(entry, logarithmic=logarithmic or {}) for entry in entries]:
        runs = Values(columns, entry.labels, legends, units).where(entry.where)
        values = (*entry.x, *([entry.y] if entry.y else ()), *entry.show)
        lacking = [value for value in values if not np.isfinite(runs[value]).any()]
        if lacking:
            yield f"figure {entry.name} skipped: no run has {lacking[0]}"
            continue
        if (parts := len(list(runs.parts(entry.by)))) > _MOST_PARTS:
            yield (
                f"figure {entry.name} skipped: by splits the runs into {parts} parts, more than "
                f"{_MOST_PARTS}"
            )
            continue
        only = ", ".join(runs.named(name, value) for name, value in entry.where.items())
        with styled():
            figure = _DRAW[entry.chart](entry, ": ".join(filter(None, (title, only))), runs)
        save(figure, *(folder / f"{file_name(entry.name)}.{ending}" for ending in FIGURE_FORMATS))
