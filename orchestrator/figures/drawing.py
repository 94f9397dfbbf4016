"""Figures drawn by matplotlib, with our settings and nobody else's, into files without a date.

What only looks a figure up imports :mod:`.run_figures`: matplotlib takes as long as all the rest.
"""

from __future__ import annotations

import logging
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import cycle
from math import lcm
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from tqdm import tqdm

from orchestrator.figures.event_marks import list_events
from orchestrator.figures.panels import Cell, Panel, Rows, run_line
from orchestrator.figures.run_figures import FIGURES, MOST_DRAWN, figures_of
from orchestrator.figures.style import (
    COLOURS,
    FIGURE_FORMATS,
    FIGURE_WIDTH,
    SETTINGS,
    Drawn,
    escape_math,
    heading,
)
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.vehicle.signals import Loop

#: What a file would say of its time and tool, by its ending.
_NO_DATE: dict[str, Any] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}

#: Room for a heading, and for a row of a legend [in].
_HEADING, _ROW = 0.3, 0.2

#: Letters in a row of a heading, and of a legend, of which the line of an entry takes some.
_HEADING_LETTERS, _LETTERS, _LINE = 74, 100, 6

#: Seconds before a bar appears on a terminal.
_PATIENCE = 2.0


class Plot(Figure):
    """A figure that a notebook shows without a call."""

    def _repr_png_(self) -> bytes:
        image = BytesIO()
        self.savefig(image, format="png")
        return image.getvalue()


@contextmanager
def styled() -> Iterator[None]:
    """Draw with :data:`.SETTINGS` and nothing that a matplotlibrc says, wherever that may be.

    What matplotlib thinks of it is not for the user.
    """
    log = logging.getLogger("matplotlib")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with mpl.rc_context(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mpl.rcdefaults()
            mpl.rcParams.update(SETTINGS)
            yield
    finally:
        log.setLevel(level)


def save(figure: Figure, *paths: Path) -> None:
    """Write a figure without the time and the tool, so that the same run gives the same file.

    Raises:
        InputError: values are too large for its axes.

    """
    with styled(), mpl.rc_context({"figure.constrained_layout.use": False}):
        # Laid out once for all files.
        if (engine := figure.get_layout_engine()) is not None:
            try:
                engine.execute(figure)
            except (ValueError, OverflowError) as error:
                raise InputError("values are too far apart to draw") from error
        figure.set_layout_engine(None)
        for path in paths:
            figure.savefig(path, metadata=_NO_DATE[path.suffix])


def legend_columns(lines: Sequence[Line2D]) -> int:
    """How many entries of a legend have room beside each other."""
    longest = max(len(str(line.get_label())) for line in lines)
    return max(1, _LETTERS // (longest + _LINE))


def name_lines(figure: Figure, lines: Sequence[Line2D], title: str = "") -> None:
    """Say above all panels which line is which run, and make room for it.

    Args:
        figure: without a heading.
        lines: one for each run.
        title: heading; empty for none.

    """
    columns = legend_columns(lines)
    figure.set_figheight(figure.get_figheight() + _ROW * -(-len(lines) // columns))
    # A heading by itself would lie upon the legend.
    legend = figure.legend(
        handles=lines, loc="outside upper center", ncols=columns, title_fontsize="large",
        title=heading(textwrap.fill(title, _HEADING_LETTERS)),
    )  # fmt: skip
    legend.get_title().set_multialignment("center")


def name_runs(figure: Figure, runs: Sequence[Drawn], title: str = "") -> None:
    """Name several runs by the lines that they have in panels: see :func:`name_lines`."""
    colours = enumerate(zip(runs, cycle(COLOURS), strict=False))
    lines = [
        Line2D([], [], **run_line(i, colour), label=escape_math(run.label))
        for i, (run, colour) in colours
    ]
    name_lines(figure, lines, title)


def compose(title: str, rows: Rows, runs: Sequence[Drawn]) -> tuple[Figure | None, list[str]]:
    """A figure of all that can be drawn.

    Args:
        title: heading; empty for none.
        rows: of the figure.
        runs: the first is the one the figure is about.

    Returns:
        The figure, and what was left out of it, and why; or None, and what is missing.

    """
    runs = [run for run in runs if len(run.result) > 1]
    if not runs:
        return None, ["step"]
    panels = [panel for row in rows for panel in row]
    shown = [panel for panel in panels if any(not run.lacks(panel.needs) for run in runs)]
    drawn = [kept for row in rows if (kept := [panel for panel in row if panel in shown])]
    if not drawn:
        return None, runs[0].lacks(panels[0].needs)
    heights = [max(panel.height for panel in row) for row in drawn]
    with styled():
        figure = Plot(figsize=(FIGURE_WIDTH, sum(heights) + _HEADING * bool(title)))
        if len(runs) > 1 and not all(panel.of_one for panel in shown):
            name_runs(figure, runs, title)
        elif title:
            figure.suptitle(heading(title), wrap=True)
        columns = lcm(*map(len, drawn))
        grid = figure.add_gridspec(len(drawn), columns, height_ratios=heights)
        for i, row in enumerate(drawn):
            width = columns // len(row)
            for j, panel in enumerate(row):
                panel.draw(Cell(figure, grid[i, j * width : (j + 1) * width]), runs)
        list_events(figure, runs)
    return figure, [note for panel in panels for note in _left_out(panel, runs)]


def _left_out(panel: Panel, runs: Sequence[Drawn]) -> list[str]:
    """What a panel does not show, and why."""
    missing = {run.label: run.lacks(panel.needs) for run in runs}
    if all(missing.values()):
        return [f"{panel.name} skipped: no {missing[runs[0].label][0]}"]
    return [
        f"{panel.name} of {label} skipped: no {names[0]}"
        for label, names in missing.items()
        if names
    ]


def one_figure(name: str, title: str, runs: Sequence[Drawn], vehicle: str = "") -> Figure:
    """One figure by its name.

    Args:
        name: key of :data:`FIGURES`, with what the name of the figure's file ends with.
        title: heading; empty for none.
        runs: the first is the one the figure is about.
        vehicle: that is shown; empty: the first.

    Raises:
        InputError: there is no such figure or vehicle, or the runs have nothing that it shows.

    """
    known = {f"{key}{end}": rows for key, of in FIGURES.items() for end, rows in of.items()}
    if name not in known:
        hint = did_you_mean(name, known) or f"; there are {', '.join(known)}"
        raise InputError(f"no figure {name!r}{hint}")
    loops = {loop.name: (i, loop) for i, loop in enumerate(runs[0].loops)}
    if vehicle and vehicle not in loops:
        raise InputError(f"no vehicle {vehicle!r}; there are {', '.join(loops)}")
    i, loop = loops[vehicle] if vehicle else (0, runs[0].loop)
    shown = [run._replace(loops=[_same(run, loop, i)]) for run in runs]
    figure, missing = compose(title, known[name], shown)
    if figure is None:
        raise InputError(f"no figure: the run has no {missing[0]}")
    return figure


def overlay(heading: str, runs: Sequence[Drawn]) -> Figure:
    """Tracking errors and commands of several runs in the same panels.

    Args:
        heading: of the figure; empty for none.
        runs: with labels that tell them apart.

    Raises:
        InputError: no run has anything to show.

    """
    figure, missing = compose(heading, FIGURES["overlay"][""], runs)
    if figure is None:
        raise InputError(f"no figure: the runs have no {missing[0]}")
    return figure


def draw(
    kind: str,
    title: str,
    runs: Sequence[Drawn],
    folder: Path,
    stem: str,
    stop: Callable[[], bool] = lambda: False,
) -> list[str]:
    """Draw the figures of a scenario, as PNG and SVG, as far as the runs have what they show.

    Several vehicles have one together. Each of a few has its own, with the vehicle of that name in
    the other runs.

    Args:
        kind: key of :data:`FIGURES`.
        title: heading; empty where there is one beside the figure.
        runs: the run of the scenario, and those it is compared with.
        folder: to write into.
        stem: of the file names.
        stop: asked before each figure whether to leave it out.

    Returns:
        What was left out, and why.

    """
    notes: list[str] = []
    loops = runs[0].loops
    for key, vehicle, drawn in figures_of(kind, loops):
        of_vehicles, name = list(runs), title
        if len(drawn) < len(loops):
            [loop] = drawn
            i = loops.index(loop)
            of_vehicles = [run._replace(loops=[_same(run, loop, i)]) for run in runs]
            name = ", ".join(filter(None, (title, loop.name if title else "")))
        notes += _drawn(key, name, of_vehicles, folder, f"{stem}{vehicle}", stop)
    if len(loops) > MOST_DRAWN:
        notes.append(f"no figure of each of {len(loops)} vehicles, only of all together")
    return notes


def _same(run: Drawn, loop: Loop, i: int) -> Loop:
    """The loop of a run that is drawn beside another's: the one of the same vehicle."""
    named = [own for own in run.loops if own.name == loop.name]
    return next(iter([*named, *run.loops[i : i + 1], *run.loops]))


def _drawn(
    kind: str,
    title: str,
    runs: Sequence[Drawn],
    folder: Path,
    stem: str,
    stop: Callable[[], bool],
) -> list[str]:
    """Draw the figures of one vehicle, and say what was left out."""
    notes: list[str] = []
    bar = tqdm(FIGURES[kind].items(), desc="drawing", delay=_PATIENCE, disable=None, leave=False)
    for suffix, rows in bar:
        if stop():
            break
        figure, left_out = compose(title, rows, runs)
        if figure is not None:
            try:
                save(figure, *(folder / f"{stem}{suffix}.{ending}" for ending in FIGURE_FORMATS))
                notes += left_out
            except InputError as error:
                notes.append(f"{stem}{suffix} skipped: {error}")
        elif not suffix:
            return [f"no figure: the run has no {left_out[0]}"]
        else:
            notes.append(f"{stem}{suffix} skipped: no {left_out[0]}")
    return notes
