"""Panels, and the ones that several figures have: path, tracking errors, commands.

They fill axes that they are given: matplotlib is imported by :mod:`.drawing`, which gives them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from auv_fmu.language.quantities import TAU
from orchestrator.cosim import Table
from orchestrator.figures.event_marks import mark_events
from orchestrator.figures.style import (
    COLOURS,
    REFERENCE,
    STYLES,
    Drawn,
    earth_axes,
    printed_unit,
    runs_with,
)
from orchestrator.figures.visible import draw_signal, mean_window
from orchestrator.vehicle.signals import (
    ACTUATORS,
    AXES,
    Loop,
    Needs,
    limits,
    tracking_error,
    true_control_point,
    waypoints,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec
    from matplotlib.transforms import Transform

#: An axis of a path is at least this share of the longest: a straight line lies in a box.
_FLATTEST = 0.3

#: Where limits of the actuators are in sight: when a command comes up to this share of them.
_NEAR = 0.5

#: Commands are cut off at this multiple of the limits, with a word.
_BEYOND = 1.5

#: Zero crossings reach far down in a logarithmic scale, and say nothing below this [m].
_SMALLEST_ERROR = 1e-5

#: The second of two runs: thin and solid, for dashes of a signal that swings are a smear.
_THICK, _THIN = 1.4, 0.8

#: Peaks from here on are written with an exponent [N, N.m].
_MANY = 1e6


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
        stack = [self._figure.add_subplot(grid[0])]
        stack += [self._figure.add_subplot(grid[i], sharex=stack[0]) for i in range(1, n)]
        for axes in stack:
            if axes is not stack[-1]:
                axes.tick_params(labelbottom=False)
            axes.locator_params("y", nbins=4, steps=[1, 2, 5, 10])
        return stack


class Panel(NamedTuple):
    """A part of a figure.

    Attributes:
        name: what the note calls it.
        needs: columns and parameters that a run must have, by the loop that is drawn.
        draw: fills a cell with the runs that have them.
        height: of the cell [in].
        of_one: whether it shows only the first of the runs.

    """

    name: str
    needs: Callable[[Loop], Needs]
    draw: Callable[[Cell, Sequence[Drawn]], None]
    height: float = 2.6
    of_one: bool = False


#: The rows of a figure.
Rows = Sequence[Sequence[Panel]]


def _path(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Paths of control points and their reference in three dimensions."""
    axes = cell.axes(projection="3d")
    paths = []
    for run, _ in list(runs_with(runs, Loop.for_reference))[:1]:
        paths.append(run.result.group(*run.loop.y_d))
        axes.plot(*paths[0].T, color=REFERENCE, linestyle="--", linewidth=1, label="reference")
        axes.scatter(*paths[0][0], color=REFERENCE, marker="s", s=20, label="reference start")
        if len(points := waypoints(run.result, run.loop)):
            paths.append(points)
            axes.scatter(
                *points.T, color="black", marker="x", s=25, depthshade=False, label="waypoints"
            )
    shown = list(runs_with(runs, Loop.for_control_point))
    for i, (run, colour) in enumerate(shown):
        y = true_control_point(run.result, run.loop)
        paths.append(y)
        axes.plot(*y.T, **run_line(i, colour), label=None if len(shown) > 1 else "control point")
        # Rings around each other: vehicles that start together stay to be seen.
        axes.scatter(
            *y[0], marker="o", s=20 + 50 * i, edgecolors=colour,
            facecolors="none" if i else colour, label=None if i else "vehicle start",
        )  # fmt: skip
    frame_path(axes, np.vstack(paths), runs[0].z_up)
    title(axes, "path")


def frame_path(axes: Any, points: np.ndarray, z_up: bool) -> None:
    """Limits, names and the box of axes that hold the points of paths, (n, 3) [m]."""
    points = points[np.isfinite(points).all(axis=1)]
    lower, upper = np.min(points, axis=0), np.max(points, axis=0)
    extent = np.maximum(upper - lower, _FLATTEST * max(float((upper - lower).max()), 1e-3))
    middle = (lower + upper) / 2
    low, high = (middle - 0.54 * extent).tolist(), (middle + 0.54 * extent).tolist()
    x, y, z = earth_axes(z_up)
    axes.set(
        xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]),
        xlabel=x, ylabel=y, zlabel=z,
    )  # fmt: skip
    if not z_up:
        axes.invert_yaxis()
        axes.invert_zaxis()
    box = np.maximum(extent, 0.5 * extent.max())
    flat = float(box.max() / box[2]) - 1.0
    # A tall box would reach into the panel below, a flat one into that beside it.
    zoom = min(0.95 - 0.2 * flat, 0.68 * float(np.linalg.norm(box) / box[2]))
    axes.set_box_aspect(box, zoom=zoom)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.get_major_locator().set_params(nbins=4, steps=None)
    axes.tick_params(labelsize="small", pad=0)
    # Closer by, a tick and the sign of a number are one dash.
    axes.zaxis.set_tick_params(pad=6)
    # Below a flat box the names of the axes would lie upon their numbers, and beside it far away.
    axes.xaxis.labelpad = axes.yaxis.labelpad = 8 * flat
    axes.zaxis.labelpad = 14 - 4 * flat


def draw_lines(
    axes: Axes, time: np.ndarray, values: np.ndarray, labels: Sequence[str], number: int = 0
) -> None:
    """One line for each column of values.

    Args:
        axes: to draw into.
        time: of the rows of values [s].
        values: (rows, lines).
        labels: of the lines.
        number: of the run; from 1 on they are those that another is compared with, thin and black.

    """
    for i, (column, label) in enumerate(zip(values.T, labels, strict=True)):
        if number == 0:
            axes.plot(time, column, color=COLOURS[i], linestyle=STYLES[i], label=label)
        else:
            is_first = (number, i) == (1, 0)
            axes.plot(
                time, column, color="black", linewidth=0.7, label="other run" if is_first else None
            )


def draw_all_errors(axes: Axes, runs: Sequence[Drawn]) -> None:
    """The three tracking errors of some runs in one panel."""
    for i, (run, _) in enumerate(runs_with(runs, Loop.for_tracking)):
        errors = tracking_error(run.result, run.loop)
        draw_lines(axes, run.result.time, errors, [f"$e_{k}$" for k in AXES], i)
    axes.set_ylabel("error [m]")
    title(axes, "tracking errors")


def title(axes: Axes, text: str) -> None:
    """A title above the axes, and below it what the lines are: nothing lies upon the data."""
    n = len(axes.get_legend_handles_labels()[0])
    if n < 2:
        axes.set_title(text)
        return
    axes.legend(
        title=text, alignment="left", ncols=n if n < 4 else -(-n // 2), loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
    )  # fmt: skip


def over_time(panels: Sequence[Axes], runs: Sequence[Drawn], has_means: bool = False) -> None:
    """One axis of time for some panels: all of the runs, named below the last, and their events."""
    start = min(run.result.time[0] for run in runs)
    end = max(run.result.time[-1] for run in runs)
    for axes in panels:
        axes.set_xlim(start, end)
    mark_events(panels, runs)
    window = mean_window(runs[0].result.time)
    means = f" (line: {window:.3g} s mean, band: raw)" if has_means else ""
    panels[-1].set_xlabel(f"time [s]{means}")


def _errors(cell: Cell, runs: Sequence[Drawn], logarithmic: bool = False) -> None:
    """Tracking errors of some runs, an axis a panel."""
    panels = cell.stack(3)
    for i, (run, colour) in enumerate(runs_with(runs, Loop.for_tracking)):
        errors = tracking_error(run.result, run.loop)
        for axes, error in zip(panels, (np.abs(errors) if logarithmic else errors).T, strict=True):
            axes.plot(run.result.time, error, **run_line(i, colour))
    for k, axes in zip(AXES, panels, strict=True):
        axes.set_ylabel(f"$|e_{k}|$ [m]" if logarithmic else f"$e_{k}$ [m]")
        if logarithmic:
            axes.set_yscale("log")
            axes.yaxis.get_major_locator().set_params(numticks=5)
            if axes.get_ylim()[1] > _SMALLEST_ERROR:
                axes.set_ylim(bottom=max(_SMALLEST_ERROR, axes.get_ylim()[0]))
    title(panels[0], "tracking errors" + ", logarithmic" * logarithmic)
    over_time(panels, runs)


def run_line(i: int, colour: str) -> dict[str, Any]:
    """The line of the run a figure is about, and, thin upon it, of those it is compared with."""
    return {"color": colour, "linewidth": _THIN if i else _THICK}


def draw_commands(
    panels: Sequence[Axes], runs: Sequence[Drawn], name: str = "commanded control signals"
) -> None:
    """Commands of some runs and the limits of (3), an actuator a panel."""
    shown = list(runs_with(runs, Loop.for_commands))
    limited = [run for run, _ in runs_with(runs, Loop.for_limits)]
    has_means = False
    for k, axes, unit in zip(range(3), panels, map(printed_unit, TAU.values()), strict=True):
        for i, (run, colour) in enumerate(shown):
            command = partial(_command, run.loop.commanded[k])
            has_means |= draw_signal(axes, run.result, command, **run_line(i, colour))
        axes.set_ylabel(rf"$\tau_{ACTUATORS[k]}$ [{unit}]")
        if limited:
            _show_limits(axes, k, shown, limited[0], unit)
    title(panels[0], name)
    over_time(panels, runs, has_means)


def _command(column: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    """A command is held until the next one, the last until the end of the run."""
    command = table.step_values(column)[:, 0]
    return np.append(table.step_start, table.time[-1]), np.append(command, command[-1])


def _show_limits(
    axes: Axes, k: int, runs: Sequence[tuple[Drawn, str]], limited: Drawn, unit: str
) -> None:
    """Limits of an actuator; of commands that are cut off the largest, in the colour of its run."""
    lower, upper = (float(limit[k]) for limit in limits(limited.result, limited.loop))
    words = (
        f"limits ±{upper:g} {unit}" if lower == -upper else f"limits {lower:g}, {upper:g} {unit}"
    )
    peaks = ((_peak(run.result.step_values(run.loop.commanded[k])), colour) for run, colour in runs)
    peak, colour = max(peaks, key=lambda one: abs(one[0]))
    if abs(peak) < _NEAR * min(upper, -lower):
        bottom, top = axes.get_ylim()
        axes.set_ylim(bottom, top + 0.2 * (top - bottom))
        _say(axes, [(f"{words} (off scale)", "black")], 0.98, axes.transAxes, "top")
        return
    for limit in (lower, upper):
        axes.axhline(limit, color="black", linewidth=0.8)
    bottom, _ = axes.get_ylim()
    axes.set_ylim(max(min(bottom, 1.2 * lower), _BEYOND * lower), _BEYOND * upper)
    said = [(words, "black")]
    if abs(peak) > _BEYOND * max(upper, -lower):
        number = f"{peak:,.0f}" if abs(peak) < _MANY else f"{peak:.2g}"
        number = number.replace("-", "\N{MINUS SIGN}")
        said.append((f"peak {number} {unit}", colour))
    _say(axes, said, upper, axes.get_yaxis_transform(), "bottom")


def _say(
    axes: Axes, words: Sequence[tuple[str, str]], y: float, transform: Transform, va: str
) -> None:
    """Words in their colours at the right of a panel, legible upon lines."""
    place: tuple[Any, ...] = (1.0, y), transform, (0, 2 if va == "bottom" else 0)
    for text, colour in reversed(words):
        at, coordinates, offset = place
        said = axes.annotate(
            text, at, xycoords=coordinates, xytext=offset, textcoords="offset points",
            ha="right", va=va, fontsize="small", color=colour,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
        )  # fmt: skip
        place = (0.0, 0.0 if va == "bottom" else 1.0), said, (-5, 0)


def _peak(values: np.ndarray) -> float:
    """The value that is the farthest from 0, with its sign."""
    values = values[np.isfinite(values)]
    return float(values[np.abs(values).argmax()]) if len(values) else 0.0


PATH = Panel("path", Loop.for_control_point, _path, 3.4)
ERRORS = Panel("tracking errors", Loop.for_tracking, _errors, 4.0)
LOGARITHMIC_ERRORS = Panel(
    "logarithmic tracking errors", Loop.for_tracking, partial(_errors, logarithmic=True), 4.0
)
COMMANDS = Panel(
    "commands", Loop.for_commands, lambda cell, runs: draw_commands(cell.stack(3), runs), 4.0
)
