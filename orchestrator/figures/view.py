"""One page to turn a run around and play it: the path in space, beside it signals over time.

The body of the vehicle that it shows is the one in films, too.
"""

from __future__ import annotations

import html
import json
from collections.abc import Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.attitude import rotation_from_euler
from fmus.ports.quantities import TAU, THETA
from orchestrator.figures.style import COLOURS, REFERENCE, Drawn, earth_axes, printed_unit
from orchestrator.machine.errors import InputError
from orchestrator.master.observers.table import Table
from orchestrator.vehicle.signals import (
    AXES,
    Loop,
    limits,
    real_parameter,
    tracking_error,
    true_control_point,
    waypoints,
)

_PAGE = Path(__file__).with_name("view.html")

#: Instants at which the vehicle is shown.
_FRAMES = 1000

#: Times into which a line is divided, of each of which it keeps the smallest and largest value.
_DIVISIONS = 700

#: Length of the drawn vehicle as a share of the largest extent of the scene, and times ell.
_SHARE, _LENGTH = 0.18, 2.0

#: Height of a panel of the series, and of the gaps between them [px].
_PANEL, _GAP, _MARGIN = 150, 26, 40

#: Digits of numbers in the page: more than a screen resolves.
_DIGITS = 6

#: Distance behind the nose and radius of the rings of the hull, as shares of its length.
_RINGS = (
    (0.0, 0.0),
    (0.02, 0.04),
    (0.08, 0.075),
    (0.18, 0.09),
    (0.7, 0.09),
    (0.9, 0.05),
    (1, 0.02),
)

#: Sides of the hull.
_SIDES = 12

#: Corners of the upper fin, as shares of the length behind the nose and above the axis.
_FIN = ((0.74, 0.05), (0.84, 0.22), (0.94, 0.22), (0.94, 0.03))

#: Axes of the paper's words, whose z is up, in axes whose z is down; in the earth and in the body.
Z_UP = np.array([1.0, -1.0, -1.0])

#: Colours of the hull, the upper fin, which shows the roll, and the other fins.
PAINT = (COLOURS[5], COLOURS[0], REFERENCE)


class Body(NamedTuple):
    """Triangles of a vehicle of length 1, its nose in the origin.

    Attributes:
        points: in the body frame, x ahead, y to starboard, z down; (n, 3).
        triangles: of points, (m, 3).
        part: of each triangle, an index of :data:`PAINT`.

    """

    points: np.ndarray
    triangles: np.ndarray
    part: np.ndarray


def body() -> Body:
    """Hull and fins."""
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    points = [
        (-behind, radius * np.cos(a), radius * np.sin(a))
        for behind, radius in _RINGS
        for a in angles
    ]
    triangles = []
    for ring in range(len(_RINGS) - 1):
        for side in range(_SIDES):
            a, b = ring * _SIDES + side, ring * _SIDES + (side + 1) % _SIDES
            triangles += [(a, b, a + _SIDES), (b, b + _SIDES, a + _SIDES)]
    parts = [0] * len(triangles)
    # Up, to starboard, down, to port.
    for i, (y, z) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
        n = len(points)
        points += [(-behind, height * y, height * z) for behind, height in _FIN]
        triangles += [(n, n + 1, n + 2), (n, n + 2, n + 3)]
        parts += [2 if i else 1] * 2
    return Body(np.array(points), np.array(triangles), np.array(parts))


class _Lines(NamedTuple):
    """A panel of the series."""

    title: str
    names: Sequence[str]
    time: np.ndarray
    values: np.ndarray
    limits: Sequence[float] = ()


def view_page(title: str, run: Drawn) -> str:
    """A page of a run that needs no other file.

    Args:
        title: heading.
        run: that is shown.

    Raises:
        InputError: plotly is not installed, or the run has no vehicle.

    """
    if find_spec("plotly") is None:
        raise InputError("view needs plotly: pip install 'auv-fmu[view]'")
    if missing := run.lacks(Loop.for_control_point):
        raise InputError(f"has no vehicle to show: no {missing[0]}")
    panels, notes = _panels(run)
    data = _frames(run) | {"series": _series(panels)}
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    fields = {
        "title": html.escape(title),
        "notes": html.escape("; ".join(("The vehicle is drawn larger than it is", *notes)) + "."),
        "plotly": import_module("plotly.offline").get_plotlyjs(),
        # What ends the script's element must not occur in it.
        "data": text.replace("</", "<\\/"),
    }
    before, *parts = _PAGE.read_text(encoding="utf-8").split("{{")
    return before + "".join(
        fields[name] + rest for name, _, rest in (part.partition("}}") for part in parts)
    )


def _panels(run: Drawn) -> tuple[list[_Lines], list[str]]:
    """What is shown over time, and what is left out, and why."""
    panels: list[_Lines] = []
    notes: list[str] = []
    for name, needs, lines in (
        ("tracking errors", Loop.for_tracking, _errors),
        ("commands", Loop.for_commands, _commands),
        ("estimated parameters", Loop.for_parameter_estimates, _estimates),
        ("velocity", Loop.for_velocity_estimates, _velocities),
    ):
        if missing := run.lacks(needs):
            notes.append(f"{name} skipped: no {missing[0]}")
        else:
            panels += lines(run.result, run.loop)
    return panels, notes


def _errors(table: Table, loop: Loop) -> Iterator[_Lines]:
    names = [f"e<sub>{k}</sub>" for k in AXES]
    yield _Lines("tracking errors [m]", names, table.time, tracking_error(table, loop))


def _commands(table: Table, loop: Loop) -> Iterator[_Lines]:
    ends = [] if table.missing(*loop.for_limits()) else limits(table, loop)
    for k, (column, (actuator, unit)) in enumerate(zip(loop.commanded, TAU.items(), strict=True)):
        name = f"τ<sub>{actuator}</sub>"
        values, bounds = table.step_values(column), [float(end[k]) for end in ends]
        yield _Lines(
            f"command {name} [{printed_unit(unit)}]", [name], table.step_start, values, bounds
        )


def _estimates(table: Table, loop: Loop) -> Iterator[_Lines]:
    names = [f"θ̂<sub>{i}</sub> [{unit}]" for i, unit in THETA.items()]
    values = table.step_values(*loop.theta_hat)
    yield _Lines("estimated parameters", names, table.step_start, values)


def _velocities(table: Table, loop: Loop) -> Iterator[_Lines]:
    estimates, truth = table.step_values(*loop.dy_hat), table.start_values(*loop.dy)
    for k, axis in enumerate(AXES):
        values = np.column_stack((estimates[:, k], truth[:, k]))
        yield _Lines(f"velocity in {axis} [m/s]", ["estimated", "true"], table.step_start, values)


def _series(panels: Sequence[_Lines]) -> dict[str, Any]:
    """Panels above each other, with one axis of time and a cursor."""
    height = _MARGIN + len(panels) * (_PANEL + _GAP)
    layout: dict[str, Any] = {
        "height": height,
        "margin": {"l": 50, "r": 12, "t": 4, "b": _MARGIN},
        "hovermode": "x unified",
        # One hover for all panels.
        "hoversubplots": "axis",
        "xaxis": {"title": {"text": "time [s]"}, "anchor": _axis("y", len(panels))},
        "shapes": [
            {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": 0, "x1": 0}
            | {"line": {"color": REFERENCE, "width": 1}}
        ],
        "annotations": [],
        "template": "none",
    }
    traces = []
    share = 1.0 / max(len(panels), 1)
    for i, panel in enumerate(panels, start=1):
        top = 1.0 - (i - 1) * share
        bottom, upper = top - share, top - share * _GAP / (_PANEL + _GAP)
        axis = {"domain": [bottom, upper], "nticks": 5, "zeroline": False}
        title = panel.title
        if panel.limits:
            low, high = panel.limits
            title += f", limits ±{high:g}" if low == -high else f", limits {low:g}, {high:g}"
            traces += [_limit(limit, panel.time, i) for limit in panel.limits]
            axis["range"] = _range(panel)
        layout[_axis("yaxis", i)] = axis
        layout["annotations"].append(
            {"text": title, "xref": "paper", "yref": "paper", "x": 0, "y": upper}
            | {"xanchor": "left", "yanchor": "bottom", "showarrow": False, "font": {"size": 12}}
        )
        layout[_axis("legend", i)] = {
            "orientation": "h", "x": 1, "xanchor": "right", "y": upper, "yanchor": "bottom",
            "bgcolor": "rgba(0,0,0,0)", "font": {"size": 11},
        }  # fmt: skip
        for column, name, colour in zip(panel.values.T, panel.names, COLOURS, strict=False):
            rows = extremes(column, _DIVISIONS)
            traces.append(
                {
                    "x": _numbers(panel.time[rows]), "y": _numbers(column[rows]), "name": name,
                    "yaxis": _axis("y", i), "legend": _axis("legend", i),
                    "showlegend": len(panel.names) > 1, "mode": "lines",
                    "line": {"color": colour, "width": 1.3},
                }
            )  # fmt: skip
    narrow = [_coloured(panel) for panel in panels]
    return {"traces": traces, "layout": layout, "narrow": narrow}


def _coloured(panel: _Lines) -> str:
    """The names of the lines of a panel in their colours, in place of a legend."""
    names = zip(panel.names, COLOURS, strict=False)
    return " ".join(f'<span style="color:{colour}">{name}</span>' for name, colour in names)


def _axis(name: str, i: int) -> str:
    return name if i == 1 else f"{name}{i}"


def _limit(limit: float, time: np.ndarray, i: int) -> dict[str, Any]:
    return {
        "x": _numbers(time[[0, -1]]), "y": [limit, limit], "yaxis": _axis("y", i),
        "mode": "lines", "line": {"color": "black", "width": 1}, "hoverinfo": "skip",
        "showlegend": False,
    }  # fmt: skip


def _range(panel: _Lines) -> list[float]:
    """Where the values are; the limits are in sight when they are near, or by zooming out."""
    finite = panel.values[np.isfinite(panel.values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (-1.0, 1.0)
    for limit in panel.limits:
        if max(high, -low) > 0.5 * abs(limit):
            low, high = min(low, limit), max(high, limit)
    margin = 0.08 * (high - low) or 1.0
    return [low - margin, high + margin]


def extremes(values: np.ndarray, divisions: int) -> np.ndarray:
    """Rows of a line that can be seen: of each division the smallest and the largest value."""
    n = len(values)
    if n <= 2 * divisions:
        return np.arange(n)
    parts = np.array_split(np.arange(n), divisions)
    chosen = [part[[values[part].argmin(), values[part].argmax()]] for part in parts]
    rows: np.ndarray = np.unique(np.concatenate([*chosen, [0, n - 1]]))
    return rows


def _frames(run: Drawn) -> dict[str, Any]:
    """The scene, and what moves in it."""
    table, loop, z_up = run.result, run.loop, run.z_up
    y, time = true_control_point(table, loop), table.time
    paths = [y]
    if not table.missing(loop.y_d):
        paths.append(table.group(*loop.y_d))
    points = waypoints(table, loop)
    seen = np.vstack((*paths, points))
    lower, upper = np.min(seen, axis=0), np.max(seen, axis=0)
    length = max(_SHARE * float((upper - lower).max()), _LENGTH * real_parameter(table, loop.ell))
    instants = np.linspace(time[0], time[-1], _FRAMES)
    rows = np.unique(np.searchsorted(time, instants).clip(0, len(time) - 1))
    frames: dict[str, Any] = {
        "time": _numbers(time[rows]),
        "position": [_numbers(point) for point in y[rows]],
        "rotation": [
            _numbers(np.ravel(rotation_from_euler(*euler)))
            for euler in table.group(*loop.attitude)[rows].tolist()
        ],
    }
    traces = []
    if len(paths) > 1:
        frames["reference"] = [_numbers(point) for point in paths[1][rows]]
        traces.append(_line(paths[1][rows], REFERENCE, 3, "reference"))
    traces.append(_line(y[rows], "#b3d4e8", 2, "future path"))
    if len(points):
        marker = {"color": "black", "size": 3, "symbol": "diamond"}
        traces.append(
            _line(points, "black", 1, "waypoints") | {"mode": "markers", "marker": marker}
        )
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
        parts.append([_numbers(point) for point in corners[used]])
        traces.append(
            {"type": "mesh3d", "i": i, "j": j, "k": k, "color": colour, "name": name}
            | {"x": [0.0], "y": [0.0], "z": [0.0], "hoverinfo": "skip", "flatshading": True}
        )
    if len(paths) > 1:
        traces.append(
            _line(paths[1][:1], REFERENCE, 1, "reference (now)")
            | {"mode": "markers", "marker": {"color": REFERENCE, "size": 4, "symbol": "square"}}
        )
    low, high = lower - length, upper + length
    ratio = (high - low) / float((high - low).max())
    axes = {}
    for i, text in enumerate(earth_axes(z_up)):
        # y and z are turned around both or neither: the axes are right-handed.
        ends = [low[i], high[i]] if i == 0 or z_up else [high[i], low[i]]
        axes[f"{text[0]}axis"] = {"title": {"text": text}, "range": ends, "nticks": 5}
    layout = {
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
    return {
        "frames": frames,
        "parts": parts,
        "moving": list(range(moving, len(traces))),
        "scene": {"traces": traces, "layout": layout},
    }


def _line(points: np.ndarray, colour: str, width: float, name: str) -> dict[str, Any]:
    x, y, z = (_numbers(values) for values in points.T)
    return {
        "type": "scatter3d", "mode": "lines", "x": x, "y": y, "z": z, "name": name,
        "line": {"color": colour, "width": width}, "hoverinfo": "skip",
    }  # fmt: skip


def _numbers(values: np.ndarray) -> list[float | None]:
    """Numbers for JSON, which has no infinity; more digits than a screen resolves."""
    return [float(f"{v:.{_DIGITS}g}") if np.isfinite(v) else None for v in values.tolist()]
