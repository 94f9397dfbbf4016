"""Figures of a study.

A new kind is a function here, an entry of :data:`_DRAW`, and an entry of :data:`.CHARTS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter

from orchestrator.figures.drawing import save, styled
from orchestrator.figures.study_values import VERDICTS, FigureEntry, Values
from orchestrator.figures.style import COLOURS, FIGURE_FORMATS, FIGURE_WIDTH, STYLES, heading
from orchestrator.machine.disk import file_name

#: Heights of a row of panels, of a single panel, of a row of a matrix and of the space around it,
#: and least height of a colour bar with its label [in].
_ROW, _SQUARE, _LINE, _AROUND, _BAR = 2.3, 4.0, 0.27, 0.5, 1.3

#: Heights of a heading, and of a legend or of labels of axes [in].
_HEADING, _NAMES = 0.3, 0.45

#: Bands: number of bins, shares of the runs below and above which the band ends, and panels in a
#: row if there is one x.
_BINS, _LOWER, _UPPER, _ABREAST = 30, 0.1, 0.9, 2

#: Maps: least and largest number of bins along each axis, number of runs in a cell from which
#: there are more than the least, and the share of cells at each end that have the colour of the
#: end, so that a few outliers do not dim the others.
_CELLS, _MOST_CELLS, _ENOUGH, _FAR = 24, 200, 30, 0.01

#: Up to so many different values have a bin each, or as many as a map has cells if each occurs at
#: least as often as there are values, as in a grid.
_GRID = 40

#: Fronts: largest number of dots of a part of the runs, and opacities of a cell with one run and of
#: the one with most.
_MOST_DOTS, _OPACITIES = 20_000, (0.15, 0.7)

#: Colour scales that the colour-blind can read and that survive print, and the colour of a cell
#: without runs. Correlations: blue falls, red grows.
_VALUES, _EMPTY, _CORRELATIONS = "cividis", "lightgrey", "RdBu_r"

#: Influence: numbers are white on colours from here on; smaller numbers are not printed, on this
#: colour; the matrix has about this share of the width.
_DARK, _NOTHING, _FAINT, _MATRIX = 0.6, 0.05, "#F7F7F7", 0.5

#: Largest number of lines or panels.
_MOST_PARTS = 12

#: Logarithmic axes: numbers at most, decades up to which there are ticks between them, and
#: decades below which also 3 has a number (below one decade 2 and 5).
_TICKS, _SMALL_TICKS, _FEW = 6, 12, 2.5

#: Logarithmic axes between these have plain numbers, others powers of ten.
_PLAIN = 1e-3, 1e4

#: An axis is logarithmic if its values are positive and their quantile of this share is so many
#: times the opposite one.
_LARGE, _WIDE = 0.95, 10.0

#: Largest difference between the ratios of a geometric grid, as a share of the ratio minus 1.
_EVEN = 1e-6


# Bins and axes


@dataclass(frozen=True)
class Bins:
    """The bins of an axis.

    Attributes:
        edges: one more than there are bins.
        centres: of the bins; the values of a grid.
        is_logarithmic: True for a logarithmic axis.

    """

    edges: np.ndarray
    centres: np.ndarray
    is_logarithmic: bool

    def places(self, values: np.ndarray) -> np.ndarray:
        """Return the number of the bin of each value."""
        places: np.ndarray = np.searchsorted(self.edges[1:-1], values, side="right")
        return places


def is_logarithmic(values: np.ndarray) -> bool:
    """Return true if values are so far apart that only a logarithmic axis shows them all."""
    values = values[np.isfinite(values)]
    if not values.size or values.min() <= 0.0:
        return False
    small, large = np.quantile(values, (1.0 - _LARGE, _LARGE))
    return bool(large >= _WIDE * small)


def _is_geometric(grid: np.ndarray) -> bool:
    """Return true if each value of a sorted grid is the same multiple of the one before."""
    if len(grid) < 3 or grid[0] <= 0.0:
        return False
    ratios = grid[1:] / grid[:-1]
    return bool(np.ptp(ratios) < _EVEN * (ratios[0] - 1.0))


def bins_of(
    values: np.ndarray, most: int, *, are_full: bool = False, is_wide: bool | None = None
) -> Bins:
    """Return bins for values, at least one of which is finite.

    Args:
        values: of a grid, or any.
        most: number of bins of values that are no grid.
        are_full: if set, these bins have equally many values, else equal widths.
        is_wide: True for a logarithmic axis; None: decided by the values.

    """
    values = values[np.isfinite(values)]
    if is_wide is None:
        is_wide = is_logarithmic(values) or _is_geometric(np.unique(values))
    places = np.unique(np.log(values) if is_wide else values)
    is_grid = len(places) <= _MOST_CELLS and len(places) ** 2 <= len(values)
    if len(places) > _GRID and not is_grid:
        even = np.linspace(0.0, 1.0, most + 1)
        edges = np.quantile(places, even) if are_full else np.interp(even, (0, 1), places[[0, -1]])
        centres = 0.5 * (edges[1:] + edges[:-1])
    else:
        between = 0.5 * (places[1:] + places[:-1])
        # The outer bins are as wide as if there were one more neighbour.
        first, last = (between[0], between[-1]) if between.size else (places + 0.5, places - 0.5)
        edges = np.hstack((2.0 * places[0] - first, between, 2.0 * places[-1] - last))
        centres = places
    if is_wide:
        edges, centres = np.exp(edges), np.exp(centres)
    return Bins(edges, centres, is_wide)


@dataclass(frozen=True)
class Groups:
    """The finite values in each of some bins.

    Attributes:
        values: bin by bin, and sorted in each.
        ends: the place of the first value of each bin, and that after the last of all.

    """

    values: np.ndarray
    ends: np.ndarray

    @classmethod
    def of(cls, places: np.ndarray, values: np.ndarray, n: int) -> Groups:
        """Group values in n bins by the number of the bin of each."""
        finite = np.isfinite(values)
        if not finite.all():
            places, values = places[finite], values[finite]
        # Small numbers are sorted sooner.
        places = places.astype(np.min_scalar_type(n))
        order = np.lexsort((values, places))
        sizes = np.bincount(places, minlength=n)
        return cls(values[order], np.append(0, sizes.cumsum()))

    @property
    def means(self) -> np.ndarray:
        """Mean of each bin; nan for an empty one."""
        sums = np.append(0.0, self.values.cumsum())[self.ends]
        return _shares(np.diff(sums), np.diff(self.ends))

    def quantiles(self, share: float) -> np.ndarray:
        """Return a quantile of each bin, between its values; nan for an empty one."""
        first, last = self.ends[:-1], self.ends[1:] - 1
        place = share * (last - first)
        low = first + np.floor(place).astype(int)
        has = first <= last
        ends = np.full((2, len(first)), np.nan)
        for row, places in zip(ends, (low, np.minimum(low + 1, last)), strict=True):
            row[has] = self.values[places[has]]
        quantiles: np.ndarray = ends[0] + (place % 1.0) * (ends[1] - ends[0])
        return quantiles

    def middles(self, value: str) -> np.ndarray:
        """Return what stands for each bin: the share of a verdict, else the median."""
        return self.means if value in VERDICTS else self.quantiles(0.5)


def _shares(parts: np.ndarray, of: np.ndarray) -> np.ndarray:
    shares: np.ndarray = np.divide(parts, of, out=np.full(len(of), np.nan), where=of > 0)
    return shares


def _scale(axis: Any, is_wide: bool) -> None:
    """Make an axis logarithmic, with ticks at a few powers of ten, if its values are wide."""
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
    if low >= _PLAIN[0] and high <= _PLAIN[1]:
        axis.set_major_formatter("{x:g}")


def _panels(
    title: str, rows: int, columns: int, height: float, **options: Any
) -> tuple[Figure, Any]:
    """Return a figure and its axes in rows [in high] and columns; options are of `subplots`."""
    figure = Figure(figsize=(FIGURE_WIDTH, rows * height + _NAMES + _HEADING * bool(title)))
    if title:
        figure.suptitle(heading(title), wrap=True)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _add_legend(figure: Figure, *samples: Artist) -> None:
    """Add a legend below all panels: of their lines, and of samples with labels."""
    handles = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    handles |= {str(sample.get_label()): sample for sample in samples}
    if len(handles) > 1 or samples:
        figure.legend(
            handles=list(handles.values()), loc="outside lower center", ncols=min(2, len(handles))
        )


def _sample(colour: str, text: str, alpha: float = 1.0) -> Patch:
    return Patch(facecolor=colour, alpha=alpha, linewidth=0, label=text)


# Kinds of figures


def bands(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """Draw a row of panels for each value shown and a column for each x, with coloured bands."""
    abreast = len(entry.x) if len(entry.x) > 1 else min(_ABREAST, len(entry.show))
    shown = list(product(entry.show, entry.x))
    sharing = "row" if len(entry.x) > 1 else False
    figure, panels = _panels(title, -(-len(shown) // abreast), abreast, _ROW, sharey=sharing)
    labels, parts = runs.parts(entry.by)
    along: dict[str, tuple[Bins, np.ndarray]] = {}
    for x in entry.x:
        column = runs[x]
        bins = bins_of(column, _BINS, are_full=True, is_wide=runs.logarithmic.get(x))
        along[x] = bins, parts * len(bins.centres) + bins.places(column)
    for axes, (value, x) in zip(panels.flat, shown, strict=False):
        bins, places = along[x]
        shape, column = (len(labels), len(bins.centres)), runs[value]
        groups = Groups.of(places, column, shape[0] * shape[1])
        middles = groups.middles(value).reshape(shape)
        ends = [groups.quantiles(share).reshape(shape) for share in (_LOWER, _UPPER)]
        for label, middle, low, high, colour, style in zip(
            labels, middles, *ends, cycle(COLOURS), cycle(STYLES), strict=False
        ):
            axes.plot(bins.centres, middle, color=colour, linestyle=style, label=label)
            if value not in VERDICTS:
                axes.fill_between(bins.centres, low, high, color=colour, alpha=0.2, linewidth=0)
        if value in entry.limits:
            axes.axhline(entry.limits[value], color="black", linewidth=0.8, label="limit")
        axes.margins(x=0)
        _scale(axes.xaxis, bins.is_logarithmic)
        _scale(axes.yaxis, is_logarithmic(column))
        axes.set_xlabel(runs.label(x))
        if x == entry.x[0]:
            axes.set_title(runs.label(value))
    for axes in panels.flat[len(shown) :]:
        axes.remove()
    has_bands = any(value not in VERDICTS for value in entry.show)
    band = f"band: {_UPPER - _LOWER:.0%} of the runs, line: median"
    _add_legend(figure, *[_sample("grey", band, 0.3)] * has_bands)
    return figure


def maps(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """Draw panels of medians, or of shares of verdicts, with one colour scale for each value shown.

    The values of the last column that tells runs apart are side by side, the others stacked.
    """
    [x], y = entry.x, entry.y
    (beside, columns), (below, rows) = (runs.parts(by) for by in (entry.by[-1:], entry.by[:-1]))
    along = runs[x], runs[y]
    most = _cells(len(columns) // (len(beside) * len(below)))
    across, down = (
        bins_of(values, most, is_wide=runs.logarithmic.get(name))
        for name, values in zip((x, y), along, strict=True)
    )
    shape = len(below), len(beside), len(down.centres), len(across.centres)
    places = np.ravel_multi_index(
        (rows, columns, down.places(along[1]), across.places(along[0])), shape
    )
    figure, panels = _panels(
        title, len(entry.show) * len(below), len(beside), _ROW, sharex=True, sharey=True
    )
    has_gaps = False
    for value, own in zip(entry.show, np.split(panels, len(entry.show)), strict=True):
        middles = Groups.of(places, runs[value], prod(shape)).middles(value).reshape(shape)
        for row, name in zip(own, below, strict=True):
            row[0].set_ylabel("\n".join(filter(None, (name, runs.label(y)))))
        norm = _colour_scale(middles, value in VERDICTS)
        for axes, cells in zip(own.flat, middles.reshape(-1, *shape[2:]), strict=True):
            image = axes.pcolormesh(
                across.edges, down.edges, cells, norm=norm, cmap=_VALUES, rasterized=True
            )
            axes.set_facecolor(_EMPTY)
            axes.grid(visible=False)
            if value in entry.limits and min(cells.shape) > 1:
                edge = [entry.limits[value]]
                axes.contour(across.centres, down.centres, cells, edge, colors="white")
        label = runs.label(value)
        if value in entry.limits:
            label += f"\n(white line: {entry.limits[value]:g})"
        has_gaps |= bool(np.isnan(middles).any())
        # A share has ends; other scales end before the most distant values.
        has_ends = (norm.vmin, norm.vmax) == (0.0, 1.0)
        figure.colorbar(
            image, ax=list(own.flat), label=label, extend="neither" if has_ends else "both"
        )
    for axes, name in zip(panels[0], beside, strict=True):
        axes.set_title(name)
    for axes in panels[-1]:
        axes.set_xlabel(runs.label(x))
    # All panels share their axes.
    _scale(axes.xaxis, across.is_logarithmic)
    _scale(axes.yaxis, down.is_logarithmic)
    _add_legend(figure, *[_sample(_EMPTY, "no run has a value here")] * has_gaps)
    return figure


def _cells(n: int) -> int:
    """Return the number of bins along each axis of a map of n runs."""
    return int(np.clip((n / _ENOUGH) ** 0.5, _CELLS, _MOST_CELLS))


def _colour_scale(values: np.ndarray, is_verdict: bool) -> Any:
    values = values[np.isfinite(values)]
    if is_verdict or not len(values):
        return Normalize(0.0, 1.0)
    low, high = np.quantile(values, (_FAR, 1.0 - _FAR))
    return (LogNorm if is_logarithmic(values) else Normalize)(low, high)


def front(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """Draw a dot for each run, and a line through those that no other beats in both values.

    Where runs are many, colours show how many there are.
    """
    figure, [[axes]] = _panels(title, 1, 1, _SQUARE)
    [x] = entry.x
    labels, parts = runs.parts(entry.by)
    along = np.column_stack((runs[x], runs[entry.y]))
    are_wide = [is_logarithmic(values) for values in along.T]
    for part, (name, colour, style) in enumerate(
        zip(labels, cycle(COLOURS), cycle(STYLES), strict=False)
    ):
        points = along[parts == part]
        points = points[np.isfinite(points).all(axis=1)]
        if len(points) > _MOST_DOTS:
            _draw_density(axes, points, are_wide, colour)
        else:
            axes.plot(*points.T, ".", color=colour, markersize=2, alpha=0.25, rasterized=True)
        line = {"color": colour, "linestyle": style, "label": name, "drawstyle": "steps-post"}
        axes.plot(*pareto_front(points).T, **line)
    for axis, is_wide in zip((axes.xaxis, axes.yaxis), are_wide, strict=True):
        _scale(axis, is_wide)
    axes.set(xlabel=runs.label(x), ylabel=runs.label(entry.y))
    _add_legend(figure)
    return figure


def _draw_density(axes: Axes, points: np.ndarray, are_wide: Sequence[bool], colour: str) -> None:
    """Colour the cells of a plane in which there are points, the more of them the stronger."""
    across, down = (
        bins_of(values, _MOST_CELLS, is_wide=is_wide)
        for values, is_wide in zip(points.T, are_wide, strict=True)
    )
    shape = len(down.centres), len(across.centres)
    places = np.ravel_multi_index((down.places(points[:, 1]), across.places(points[:, 0])), shape)
    counts = np.bincount(places, minlength=prod(shape)).reshape(shape)
    colours = [(*to_rgb(colour), alpha) for alpha in _OPACITIES]
    # With margins, as dots.
    axes.use_sticky_edges = False
    axes.pcolormesh(
        across.edges, down.edges, np.ma.masked_equal(counts, 0), norm=LogNorm(1, counts.max()),
        cmap=LinearSegmentedColormap.from_list("density", colours), rasterized=True,
    )  # fmt: skip


def pareto_front(points: np.ndarray) -> np.ndarray:
    """Return the points, of (n, 2), that no other point beats in both coordinates."""
    points = points[np.lexsort(points.T[::-1])]
    lowest = np.minimum.accumulate(np.append(np.inf, points[:, 1]))
    front: np.ndarray = points[points[:, 1] < lowest[:-1]]
    return front


def influence(entry: FigureEntry, title: str, runs: Values) -> Figure:
    """Draw a matrix for each part of the runs: rows are the values shown, columns the x.

    Colours are Spearman's rank correlations: 1 if a value always grows with x, -1 if it falls, 0 if
    it does neither.
    """
    labels, parts = runs.parts(entry.by)
    height = max(_LINE * len(entry.show), _BAR / len(labels)) + _AROUND
    figure, panels = _panels(title, len(labels), 1, height, sharex=True)
    has_gaps = has_small = False
    for part, (axes, name) in enumerate(zip(panels.flat, labels, strict=True)):
        matrix = _correlations(entry, runs, np.flatnonzero(parts == part))
        image = axes.imshow(matrix, cmap=_CORRELATIONS, vmin=-1.0, vmax=1.0, aspect="auto")
        for (row, column), value in np.ndenumerate(matrix):
            if abs(value) >= _NOTHING:
                colour = "white" if abs(value) > _DARK else "black"
                axes.text(
                    column, row, f"{value:.2f}".replace("0.", "."), color=colour, fontsize="small",
                    ha="center", va="center",
                )  # fmt: skip
        axes.set_yticks(range(len(entry.show)), [runs.name(value) for value in entry.show])
        axes.set_xticks(range(len(entry.x)), [runs.name(value) for value in entry.x])
        axes.grid(visible=False)
        axes.set_facecolor(_EMPTY)
        axes.set_title(name)
        has_gaps |= bool(np.isnan(matrix).any())
        has_small |= bool((np.abs(matrix) < _NOTHING).any())
    _turn_long_names(figure, panels.flat[-1])
    names = max(name.get_window_extent().height for name in axes.get_xticklabels()) / figure.dpi
    figure.set_figheight(figure.get_figheight() + max(0.0, names - _NAMES))
    figure.colorbar(image, ax=list(panels.flat), label="rank correlation")
    _add_legend(
        figure,
        *[_sample(_FAINT, f"no number: below {_NOTHING:g} in size")] * has_small,
        *[_sample(_EMPTY, "one of the two is constant")] * has_gaps,
    )
    return figure


def _turn_long_names(figure: Figure, axes: Axes) -> None:
    """Turn the names of the columns of a matrix, if one of them is wider than its column."""
    names = axes.get_xticklabels()
    share = figure.bbox.width * _MATRIX / len(names)
    if max(name.get_window_extent().width for name in names) > share:
        axes.tick_params("x", labelrotation=45)
        for name in axes.get_xticklabels():
            name.set(ha="right", rotation_mode="anchor")


def _correlations(entry: FigureEntry, runs: Values, rows: np.ndarray) -> np.ndarray:
    """Return Spearman's rank correlations of the values shown with each x.

    They are of the runs that have both values, and nan if one of them is constant.
    """
    matrix = np.full((len(entry.show), len(entry.x)), np.nan)
    # Values that are missing in the same runs share the ranks of x.
    shown: dict[bytes, tuple[np.ndarray, list[tuple[int, np.ndarray]]]] = {}
    for i, value in enumerate(entry.show):
        column = runs[value][rows]
        has = np.isfinite(column)
        ranks = _ranks(_codes(column[has]))
        shown.setdefault(np.packbits(has).tobytes(), (has, []))[1].append((i, ranks))
    for j, x in enumerate(entry.x):
        column = runs[x][rows]
        codes = _codes(column)
        for has, same in shown.values():
            both = np.isfinite(column[has])
            own = _ranks(codes[has][both])
            for i, ranks in same:
                others = ranks if both.all() else _ranks(_codes(ranks[both]))
                matrix[i, j] = own @ others if len(own) else np.nan
    return matrix


def _codes(values: np.ndarray) -> np.ndarray:
    """Return the place of each value among those that occur."""
    codes: np.ndarray = np.unique(values, return_inverse=True)[1]
    return codes


def _ranks(codes: np.ndarray) -> np.ndarray:
    """Return the ranks of codes, of mean 0 and norm 1; equal ones share theirs, nan if all are."""
    counts = np.bincount(codes)
    ranks: np.ndarray = (counts.cumsum() - 0.5 * (counts - 1))[codes]
    ranks -= 0.5 * (len(codes) + 1)
    with np.errstate(invalid="ignore"):
        ranks /= np.linalg.norm(ranks)
    return ranks


#: Functions that draw the kinds of figures.
_DRAW: Mapping[str, Callable[[FigureEntry, str, Values], Figure]] = {
    "bands": bands,
    "maps": maps,
    "front": front,
    "influence": influence,
}


def figure_files(entries: Sequence[FigureEntry]) -> list[str]:
    """Return the names of all files that :func:`draw_figures` may write."""
    return [f"{file_name(entry.name)}.{ending}" for entry in entries for ending in FIGURE_FORMATS]


def draw_figures(
    entries: Sequence[FigureEntry], title: str, runs: Values, folder: Path
) -> Iterator[str]:
    """Draw the figures of a study as PNG and SVG, and yield a note on each that was left out.

    Args:
        entries: figures to draw.
        title: heading; empty if there is one next to the figures.
        runs: of the study.
        folder: to write into.

    """
    for entry in entries:
        shown = replace(runs, labels=entry.labels).where(entry.where)
        values = (*entry.x, *([entry.y] if entry.y else ()), *entry.show)
        lacking = [value for value in values if not np.isfinite(shown[value]).any()]
        if lacking:
            yield f"figure {entry.name} left out: no run has {lacking[0]}"
            continue
        if (parts := len(shown.parts(entry.by)[0])) > _MOST_PARTS:
            yield (
                f"figure {entry.name} left out: by splits the runs into {parts} parts, more than "
                f"{_MOST_PARTS}"
            )
            continue
        only = ", ".join(shown.named(name, value) for name, value in entry.where.items())
        with styled():
            figure = _DRAW[entry.chart](entry, ": ".join(filter(None, (title, only))), shown)
        save(figure, *(folder / f"{file_name(entry.name)}.{ending}" for ending in FIGURE_FORMATS))
