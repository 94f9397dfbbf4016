"""Panels in rows; those that no run has the signals for are left out, with a note."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import lcm
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.ticker import MaxNLocator

from orchestrator.figures.style import WIDTH, Drawn, heading, styled
from orchestrator.vehicle.signals import Loop, Needs

#: Room for a heading [in].
_HEADING = 0.3


class Cell:
    """The part of a figure that a panel may fill with axes."""

    def __init__(self, figure: Figure, place: SubplotSpec) -> None:
        """Take a place in a figure."""
        self._figure, self._place = figure, place

    def axes(self, **how: Any) -> Any:
        """Axes that fill the cell."""
        return self._figure.add_subplot(self._place, **how)

    def stack(self, n: int) -> list[Any]:
        """Some axes above each other, with one axis of time."""
        grid = self._place.subgridspec(n, 1)
        top = self._figure.add_subplot(grid[0])
        below = [self._figure.add_subplot(grid[i], sharex=top) for i in range(1, n)]
        stack = [top, *below]
        for axes in stack[:-1]:
            axes.tick_params(labelbottom=False)
        for axes in stack:
            axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        return stack


class Panel(NamedTuple):
    """A part of a figure.

    Attributes:
        name: what the note calls it.
        needs: columns and parameters that a run must have, by the loop that is drawn.
        draw: fills a cell with the runs that have them.
        height: of the cell [in].

    """

    name: str
    needs: Callable[[Loop], Needs]
    draw: Callable[[Cell, Sequence[Drawn]], None]
    height: float = 2.6


#: The rows of a figure.
Rows = Sequence[Sequence[Panel]]


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
    drawn = [[panel for panel in row if _shows(panel, runs)] for row in rows]
    drawn = [row for row in drawn if row]
    if not drawn:
        return None, runs[0].lacks(panels[0].needs)
    heights = [max(panel.height for panel in row) for row in drawn]
    with styled():
        figure = Figure(figsize=(WIDTH, sum(heights) + _HEADING * bool(title)))
        if title:
            figure.suptitle(heading(title), wrap=True)
        columns = lcm(*map(len, drawn))
        grid = figure.add_gridspec(len(drawn), columns, height_ratios=heights)
        for i, row in enumerate(drawn):
            width = columns // len(row)
            for j, panel in enumerate(row):
                panel.draw(Cell(figure, grid[i, j * width : (j + 1) * width]), runs)
    return figure, [note for panel in panels for note in _left_out(panel, runs)]


def _shows(panel: Panel, runs: Sequence[Drawn]) -> bool:
    return any(not run.lacks(panel.needs) for run in runs)


def _left_out(panel: Panel, runs: Sequence[Drawn]) -> list[str]:
    """What a panel does not show, and why."""
    missing = {run.label: run.lacks(panel.needs) for run in runs}
    if all(missing.values()):
        return [f"{panel.name} left out: no {missing[runs[0].label][0]}"]
    return [
        f"{panel.name} of {label} left out: no {names[0]}"
        for label, names in missing.items()
        if names
    ]
