"""Panels that show the vehicles of a run together: paths, errors, and how far they are apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from orchestrator.figures.panels import Cell, Panel, frame_path, over_time, title
from orchestrator.figures.style import COLOURS, REFERENCE, Drawn, earth_axes, vehicle_colours
from orchestrator.vehicle.indices import (
    SMALLEST_DISTANCE_LABEL,
    distances,
    for_distances,
    size,
    smallest_distances,
)
from orchestrator.vehicle.signals import Loop, tracking_error, true_control_point

#: Instants at which the vehicles are joined by lines.
_INSTANTS = 9

#: Of more vehicles, no line is named, and no pair has a line of its own.
_MOST_NAMED = 4

#: Lines of the run a figure is about, and of the one that it is compared with.
_RUN_STYLES: tuple[dict[str, Any], ...] = (
    {"linewidth": 1.3},
    {"linewidth": 0.8, "linestyle": "--"},
)


def _loops(run: Drawn, needs: Any) -> Iterator[tuple[Loop, str]]:
    """The vehicles that have what is needed, each with its colour."""
    for loop, colour in zip(run.loops, vehicle_colours(len(run.loops)), strict=True):
        if not run.result.missing(*needs(loop)):
            yield loop, colour


def _name(run: Drawn, loop: Loop) -> str | None:
    return loop.name if len(run.loops) <= _MOST_NAMED else None


def _paths(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Paths of the control points of the first run, and of their references."""
    run, axes = runs[0], cell.axes(projection="3d")
    paths = []
    for loop, _ in _loops(run, Loop.for_reference):
        paths.append(run.result.group(*loop.y_d))
        axes.plot(*paths[-1].T, color=REFERENCE, linestyle="--", linewidth=0.8)
    for loop, colour in _loops(run, Loop.for_control_point):
        paths.append(true_control_point(run.result, loop))
        axes.plot(*paths[-1].T, color=colour, linewidth=1.3, label=_name(run, loop))
        axes.scatter(*paths[-1][0], color=colour, s=20)
    frame_path(axes, np.vstack(paths), run.z_up)
    title(axes, "paths, and references (dashed)")


def _from_above(cell: Cell, runs: Sequence[Drawn]) -> None:
    """The same from above, with the vehicles joined at some instants."""
    run, (x, y, _) = runs[0], earth_axes(runs[0].z_up)
    axes = cell.axes(xlabel=y, ylabel=x)
    axes.set_aspect("equal", adjustable="datalim")
    if run.z_up:
        axes.invert_xaxis()
    shown = list(_loops(run, Loop.for_control_point))
    paths = [true_control_point(run.result, loop) for loop, _ in shown]
    for path, (_, colour) in zip(paths, shown, strict=True):
        axes.plot(path[:, 1], path[:, 0], color=colour, linewidth=0.8)
    time = run.result.time
    instants = np.linspace(time[0], time[-1], _INSTANTS)
    for row in np.searchsorted(time, instants).clip(0, len(time) - 1).tolist():
        points = np.array([path[row] for path in paths])
        # Lines from the first to each other one: a V looks like a V.
        spokes = np.array([(points[0], point) for point in points[1:]]).reshape(-1, 2, 3)
        axes.plot(*spokes[:, :, 1::-1].T, color="black", linewidth=0.8, zorder=3)
        axes.scatter(points[:, 1], points[:, 0], color=[c for _, c in shown], s=14, zorder=4)
    between = (time[-1] - time[0]) / (_INSTANTS - 1)
    title(axes, f"from above, joined every {between:.3g} s")


def _errors(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Size of the tracking error of each vehicle."""
    axes = cell.axes(ylabel="|e| [m]")
    for run, style in zip(runs, _RUN_STYLES, strict=False):
        for loop, colour in _loops(run, Loop.for_tracking):
            error = size(tracking_error(run.result, loop))
            label = _name(run, loop) if run is runs[0] else None
            axes.plot(run.result.time, error, color=colour, label=label, **style)
    axes.set_ylim(bottom=0.0)
    title(axes, _named("size of the tracking errors", runs))
    over_time([axes], runs)


def _distances(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Distance of each two of a few vehicles, and the smallest of all."""
    axes = cell.axes(ylabel="distance [m]")
    for run, style in zip(runs, _RUN_STYLES, strict=False):
        loops = [loop for loop, _ in _loops(run, lambda loop: for_distances([loop]))]
        if len(loops) <= _MOST_NAMED and run is runs[0]:
            apart = distances(run.result, loops)
            for (names, values), colour in zip(apart.items(), COLOURS, strict=False):
                axes.plot(run.result.time, values, color=colour, label=" to ".join(names), **style)
        if len(loops) > _MOST_NAMED or run is not runs[0]:
            smallest = smallest_distances(run.result, loops)
            axes.plot(run.result.time, smallest, color="black", label="smallest", **style)
    axes.set_ylim(bottom=0.0)
    title(axes, _named("distances between vehicles", runs))
    over_time([axes], runs)


def _smallest_distance(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Smallest distance between two of all vehicles."""
    axes, table = cell.axes(ylabel="distance [m]"), runs[0].result
    axes.plot(table.time, smallest_distances(table, runs[0].loops), color=REFERENCE)
    axes.set_ylim(bottom=0.0)
    title(axes, SMALLEST_DISTANCE_LABEL)
    over_time([axes], runs)


def _named(what: str, runs: Sequence[Drawn]) -> str:
    return f"{what}, {runs[1].label} dashed" if len(runs) > 1 else what


PATHS = Panel("paths", Loop.for_control_point, _paths, 3.6, of_one=True)
FROM_ABOVE = Panel("paths from above", Loop.for_control_point, _from_above, 3.6, of_one=True)
ERRORS = Panel("sizes of errors", Loop.for_tracking, _errors, 3.0, of_one=True)
DISTANCES = Panel("distances", lambda loop: for_distances([loop]), _distances, 3.0, of_one=True)
SMALLEST_DISTANCE = Panel(
    "smallest distance", lambda loop: for_distances([loop]), _smallest_distance, of_one=True
)
