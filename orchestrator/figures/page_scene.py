"""Paths in space on a page, and what moves along them."""

from __future__ import annotations

import html
from typing import Any

import numpy as np

from auv_fmu.paper.attitude import rotation_from_euler
from orchestrator.cosim.observers.table import Table
from orchestrator.figures.body import PAINT, Z_UP, body, paint_of
from orchestrator.figures.page_series import numbers, times
from orchestrator.figures.style import (
    COLOURS,
    REFERENCE,
    Drawn,
    earth_axes,
    reference_colours,
    vehicle_colours,
)
from orchestrator.vehicle.signals import Loop, real_parameter, true_control_point, waypoints

#: Instants at which a vehicle is shown: at most, at least, and of all vehicles together.
_FRAMES, _FEWEST, _TOGETHER = 1000, 200, 6000

#: Length of the drawn vehicle as a share of the largest extent of the scene, and times ell.
_SHARE, _LENGTH = 0.18, 2.0

#: Size of the mark of a reference, and at least, where many vehicles have one [px].
_MARKERS = 4, 2

#: How much is to be seen of where several vehicles will go.
_FUTURE = 0.35


def scene_of_one(run: Drawn) -> dict[str, Any]:
    """The path of a vehicle, and what moves along it."""
    table, loop, z_up = run.result, run.loop, run.z_up
    y, time = true_control_point(table, loop), table.time
    paths = [y]
    if not table.missing(loop.y_d):
        paths.append(table.group(*loop.y_d))
    points = waypoints(table, loop)
    seen = np.vstack((*paths, points))
    lower, upper = np.min(seen, axis=0), np.max(seen, axis=0)
    length = max(_SHARE * float((upper - lower).max()), _LENGTH * real_parameter(table, loop.ell))
    rows = _rows(time, _FRAMES)
    frames: dict[str, Any] = {
        "time": times(time[rows]),
        "position": _points(y[rows]),
        "rotation": _rotations(table, loop, rows),
    }
    traces = []
    if len(paths) > 1:
        frames["reference"] = _points(paths[1][rows])
        traces.append(_line(paths[1][rows], REFERENCE, 3, "reference"))
    traces.append(_line(y[rows], "#b3d4e8", 2, "future path"))
    if len(points):
        traces.append(_waypoints(points))
    moving = len(traces)
    traces.append(_line(y[:1], COLOURS[0], 5, "path of the control point"))
    shape = body()
    corners = length * shape.points * (Z_UP if z_up else 1.0)
    parts = []
    for part, (colour, name) in enumerate(
        zip(PAINT, ("vehicle", "upper fin", "other fins"), strict=True)
    ):
        chosen = shape.triangles[shape.part == part]
        used, triangles = np.unique(chosen, return_inverse=True)
        i, j, k = triangles.reshape(chosen.shape).T.tolist()
        parts.append(_points(corners[used]))
        traces.append(
            {"type": "mesh3d", "i": i, "j": j, "k": k, "color": colour, "name": name}
            | {"x": [0.0], "y": [0.0], "z": [0.0], "hoverinfo": "skip", "flatshading": True}
        )
    if len(paths) > 1:
        traces.append(_marker(paths[1][:1], REFERENCE))
    return {
        "frames": frames,
        "parts": parts,
        "moving": list(range(moving, len(traces))),
        "scene": {"traces": traces, "layout": _layout(lower, upper, length, z_up)},
    }


def scene_of_several(run: Drawn) -> dict[str, Any]:
    """The paths of several vehicles, and what moves along them.

    Frames of one vehicle follow those of the other, and so do frames of references.
    """
    table, z_up, time = run.result, run.z_up, run.result.time
    n = len(run.loops)
    rows = _rows(time, max(_FEWEST, min(_FRAMES, _TOGETHER // n)))
    paths = [true_control_point(table, loop) for loop in run.loops]
    colours = vehicle_colours(n)
    groups = [{"legendgroup": loop.name} for loop in run.loops]
    references: dict[tuple[str, ...], tuple[str, dict[str, Any]]] = {}
    for loop, colour, group in zip(run.loops, reference_colours(run.loops), groups, strict=True):
        if not table.missing(loop.y_d):
            # What several vehicles follow goes with none of them.
            references[loop.y_d] = (colour, {} if colour == REFERENCE else group)
    followed = [table.group(*columns) for columns in references]
    by_planner = {loop.planner: waypoints(table, loop) for loop in run.loops}
    points = np.vstack(list(by_planner.values()))
    seen = np.vstack((*paths, *followed, points))
    lower, upper = np.min(seen, axis=0), np.max(seen, axis=0)
    ell = max(real_parameter(table, loop.ell) for loop in run.loops)
    # Of many vehicles none hides the others.
    length = max(_SHARE * float((upper - lower).max()) / n**0.5, _LENGTH * ell)
    traces = []
    hidden = {"showlegend": False}
    for y_d, (colour, group) in zip(followed, references.values(), strict=True):
        traces.append(_line(y_d[rows], colour, 2, "reference") | hidden | group)
        traces[-1]["line"]["dash"] = "dash"
    for loop, y, colour, group in zip(run.loops, paths, colours, groups, strict=True):
        traces.append(
            _line(y[rows], colour, 2, _named(loop)) | hidden | group | {"opacity": _FUTURE}
        )
    if len(points):
        traces.append(_waypoints(points))
    moving = len(traces)
    shape = body()
    i, j, k = shape.triangles.T.tolist()
    for loop, y, colour, group in zip(run.loops, paths, colours, groups, strict=True):
        paint = [paint_of(colour)[part] for part in shape.part]
        traces += [
            _line(y[:1], colour, 5, _named(loop)) | group,
            {"type": "mesh3d", "i": i, "j": j, "k": k, "facecolor": paint, "name": _named(loop)}
            | {"x": [0.0], "y": [0.0], "z": [0.0], "hoverinfo": "skip", "flatshading": True}
            | hidden
            | group,
        ]
    size = max(_MARKERS[1], _MARKERS[0] / n**0.5)
    for y_d, (colour, group) in zip(followed, references.values(), strict=True):
        traces.append(_marker(y_d[:1], colour, size) | hidden | group)
    layout = _layout(lower, upper, length, z_up)
    layout["legend"]["tracegroupgap"] = 0
    return {
        "frames": {
            "time": times(time[rows]),
            "position": [point for y in paths for point in _points(y[rows])],
            "rotation": [R for loop in run.loops for R in _rotations(table, loop, rows)],
            "reference": [point for y_d in followed for point in _points(y_d[rows])],
        },
        "parts": [_points(length * shape.points * (Z_UP if z_up else 1.0))],
        "moving": list(range(moving, len(traces))),
        "scene": {"traces": traces, "layout": layout},
    }


def _named(loop: Loop) -> str:
    return html.escape(loop.name)


def _rows(time: np.ndarray, n: int) -> np.ndarray:
    """Rows of at most n instants that are equally far apart."""
    instants = np.linspace(time[0], time[-1], n)
    rows: np.ndarray = np.unique(np.searchsorted(time, instants).clip(0, len(time) - 1))
    return rows


def _points(values: np.ndarray) -> list[list[float | None]]:
    return [numbers(point) for point in values]


def _rotations(table: Table, loop: Loop, rows: np.ndarray) -> list[list[float | None]]:
    """R of some rows, row by row."""
    attitudes = table.group(*loop.attitude)[rows].tolist()
    return [numbers(np.ravel(rotation_from_euler(*euler))) for euler in attitudes]


def _layout(lower: np.ndarray, upper: np.ndarray, length: float, z_up: bool) -> dict[str, Any]:
    """Axes from somewhat below the lowest to somewhat above the highest, and the camera."""
    low, high = lower - length, upper + length
    ratio = (high - low) / float((high - low).max())
    axes = {}
    for i, text in enumerate(earth_axes(z_up)):
        # y and z are turned around both or neither: the axes are right-handed.
        ends = [low[i], high[i]] if i == 0 or z_up else [high[i], low[i]]
        axes[f"{text[0]}axis"] = {"title": {"text": text}, "range": ends, "nticks": 5}
    return {
        "scene": {
            **axes,
            "aspectmode": "manual",
            "aspectratio": dict(zip("xyz", ratio.tolist(), strict=True)),
            "camera": {
                "eye": {"x": -1.5, "y": -1.5, "z": 0.8},
                "center": {"x": 0, "y": 0, "z": -0.1},
            },
        },
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "legend": {"x": 0, "y": 1, "bgcolor": "rgba(255,255,255,0.6)"},
        "template": "none",
        "uirevision": "kept",
    }


def _line(points: np.ndarray, colour: str, width: float, name: str) -> dict[str, Any]:
    x, y, z = (numbers(values) for values in points.T)
    return {
        "type": "scatter3d", "mode": "lines", "x": x, "y": y, "z": z, "name": name,
        "line": {"color": colour, "width": width}, "hoverinfo": "skip",
    }  # fmt: skip


def _waypoints(points: np.ndarray) -> dict[str, Any]:
    marker = {"color": "black", "size": 3, "symbol": "diamond"}
    return _line(points, "black", 1, "waypoints") | {"mode": "markers", "marker": marker}


def _marker(point: np.ndarray, colour: str, size: float = _MARKERS[0]) -> dict[str, Any]:
    """Where a reference is now."""
    marker = {"color": colour, "size": size, "symbol": "square"}
    return _line(point, colour, 1, "reference (now)") | {"mode": "markers", "marker": marker}
