"""Signals over time on a page: panels above each other, with one axis of time and a cursor."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.language.quantities import TAU, THETA
from orchestrator.cosim.observers.table import Table
from orchestrator.figures.style import (
    COLOURS,
    REFERENCE,
    Drawn,
    printed_unit,
    vehicle_colours,
)
from orchestrator.vehicle.distances import SMALLEST_DISTANCE_LABEL, size, smallest_distances
from orchestrator.vehicle.signals import AXES, Loop, limits, tracking_error

#: Times into which a line is divided, of each of which it keeps the smallest and largest value: at
#: most, at least, and of all vehicles together.
_DIVISIONS, _FEWEST, _TOGETHER = 700, 100, 2800

#: Height of a panel of the series, and of the gaps between them [px].
_PANEL, _GAP, _MARGIN = 150, 26, 40

#: Room above and below lines, as a share of their range.
_MARGINS = 0.08

#: Digits of numbers in the page: more than a screen resolves; of times, also late in a long run.
_DIGITS, _DIGITS_OF_TIMES = 6, 12


class _Lines(NamedTuple):
    """A panel of the series.

    Attributes:
        title: above it.
        names: of its lines.
        time: of the rows of values [s].
        values: (rows, lines).
        limits: levels that are drawn, too.
        colours: of the lines.
        is_size: whether no value is negative, and zero is in sight.
        says_names: whether its lines are told apart here, and not by the scene's legend.

    """

    title: str
    names: Sequence[str]
    time: np.ndarray
    values: np.ndarray
    limits: Sequence[float] = ()
    colours: Sequence[str] = COLOURS
    is_size: bool = False
    says_names: bool = True


def series_of_one(run: Drawn) -> tuple[dict[str, Any], list[str]]:
    """The panels of a vehicle, and what is left out, and why."""
    panels, notes = _panels(run)
    traces = [trace for i, panel in enumerate(panels, 1) for trace in _traces(panel, i)]
    narrow = [_coloured(panel) for panel in panels]
    return {"traces": traces, "layout": _layout(panels), "narrow": narrow}, notes


def series_of_several(run: Drawn) -> tuple[dict[str, Any], list[str]]:
    """Panels of all vehicles, and below them those of each; and what is left out, and why."""
    common, notes = _panels_of_all(run)
    divisions = max(_FEWEST, min(_DIVISIONS, _TOGETHER // len(run.loops)))
    choices = []
    for loop in run.loops:
        own, left_out = _panels(run._replace(loops=[loop]))
        name = html.escape(loop.name)
        own = [panel._replace(title=f"{name}: {panel.title}") for panel in own]
        notes += [f"{loop.name}: {note}" for note in left_out]
        panels = [_titled(panel) for panel in (*common, *own)]
        traces = [
            trace
            for i, panel in enumerate(own, len(common) + 1)
            for trace in _traces(panel, i, divisions, has_legend=False)
        ]
        # Zoomed into a time, other vehicles are seen at that time, too.
        layout = _layout(panels, has_legends=False)
        layout["xaxis"]["uirevision"] = "kept"
        # The names of lines are in the titles already, on narrow pages, too.
        choices.append({"traces": traces, "layout": layout, "narrow": [""] * len(panels)})
    return {
        "common": [
            trace
            for i, panel in enumerate(common, 1)
            for trace in _traces(panel, i, divisions, has_legend=False)
        ],
        "choices": choices,
    }, notes


def _titled(panel: _Lines) -> _Lines:
    """A panel whose title names its lines, if there are several, in their colours."""
    if len(panel.names) < 2 or not panel.says_names:
        return panel
    return panel._replace(title=f"{panel.title}: {_coloured(panel)}")


def _panels_of_all(run: Drawn) -> tuple[list[_Lines], list[str]]:
    """What shows all vehicles over time, and what is left out, and why."""
    panels: list[_Lines] = []
    notes: list[str] = []
    table, tracked = run.result, []
    for loop, colour in zip(run.loops, vehicle_colours(len(run.loops)), strict=True):
        if missing := table.missing(*loop.for_tracking()):
            notes.append(f"{loop.name}: |e| skipped: no {missing[0]}")
        else:
            tracked.append((loop, colour))
    if tracked:
        sizes = np.column_stack([size(tracking_error(table, loop)) for loop, _ in tracked])
        names, colours = [html.escape(loop.name) for loop, _ in tracked], [c for _, c in tracked]
        panels.append(
            _Lines(
                "|e| of all vehicles [m]", names, table.time, sizes,
                colours=colours, is_size=True, says_names=False,
            )
        )  # fmt: skip
    smallest = smallest_distances(table, run.loops)[:, np.newaxis]
    text = SMALLEST_DISTANCE_LABEL
    # No vehicle's colour.
    panels.append(
        _Lines(f"{text} [m]", [text], table.time, smallest, colours=[REFERENCE], is_size=True)
    )
    return panels, notes


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


def _layout(panels: Sequence[_Lines], has_legends: bool = True) -> dict[str, Any]:
    """Panels above each other, with one axis of time and a cursor."""
    height = _MARGIN + len(panels) * (_PANEL + _GAP)
    start = float(panels[0].time[0]) if panels else 0.0
    layout: dict[str, Any] = {
        "height": height,
        "margin": {"l": 50, "r": 12, "t": 4, "b": _MARGIN},
        "hovermode": "x unified",
        # One hover for all panels.
        "hoversubplots": "axis",
        "xaxis": {"title": {"text": "time [s]"}, "anchor": _axis("y", len(panels))},
        "shapes": [
            {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": start, "x1": start}
            | {"line": {"color": REFERENCE, "width": 1}}
        ],
        "annotations": [],
        "template": "none",
    }
    share = 1.0 / max(len(panels), 1)
    for i, panel in enumerate(panels, start=1):
        top = 1.0 - (i - 1) * share
        bottom, upper = top - share, top - share * _GAP / (_PANEL + _GAP)
        axis = {"domain": [bottom, upper], "nticks": 5, "zeroline": False}
        title = panel.title
        if panel.limits:
            low, high = panel.limits
            title += f", limits ±{high:g}" if low == -high else f", limits {low:g}, {high:g}"
        if panel.limits or panel.is_size:
            axis["range"] = _range(panel)
        layout[_axis("yaxis", i)] = axis
        layout["annotations"].append(
            {"text": title, "xref": "paper", "yref": "paper", "x": 0, "y": upper}
            | {"xanchor": "left", "yanchor": "bottom", "showarrow": False, "font": {"size": 12}}
        )
        if has_legends:
            layout[_axis("legend", i)] = {
                "orientation": "h", "x": 1, "xanchor": "right", "y": upper, "yanchor": "bottom",
                "bgcolor": "rgba(0,0,0,0)", "font": {"size": 11},
            }  # fmt: skip
    return layout


def _traces(
    panel: _Lines, i: int, divisions: int = _DIVISIONS, has_legend: bool = True
) -> list[dict[str, Any]]:
    """The lines of a panel, the i-th from above."""
    traces = [_limit(limit, panel.time, i) for limit in panel.limits]
    legend = {"legend": _axis("legend", i)} if has_legend else {}
    for column, name, colour in zip(panel.values.T, panel.names, panel.colours, strict=False):
        rows = extremes(column, divisions)
        traces.append(
            {
                "x": times(panel.time[rows]), "y": numbers(column[rows]), "name": name,
                "yaxis": _axis("y", i), **legend,
                "showlegend": has_legend and len(panel.names) > 1, "mode": "lines",
                "line": {"color": colour, "width": 1.3},
            }
        )  # fmt: skip
    return traces


def _coloured(panel: _Lines) -> str:
    """The names of the lines of a panel in their colours, in place of a legend."""
    names = zip(panel.names, panel.colours, strict=False)
    return " ".join(f'<span style="color:{colour}">{name}</span>' for name, colour in names)


def _axis(name: str, i: int) -> str:
    return name if i == 1 else f"{name}{i}"


def _limit(limit: float, time: np.ndarray, i: int) -> dict[str, Any]:
    return {
        "x": times(time[[0, -1]]), "y": [limit, limit], "yaxis": _axis("y", i),
        "mode": "lines", "line": {"color": "black", "width": 1}, "hoverinfo": "skip",
        "showlegend": False,
    }  # fmt: skip


def _range(panel: _Lines) -> list[float]:
    """Where the values are; the limits are in sight when they are near, or by zooming out."""
    finite = panel.values[np.isfinite(panel.values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (-1.0, 1.0)
    if panel.is_size:
        return [0.0, (1.0 + _MARGINS) * high or 1.0]
    for limit in panel.limits:
        if max(high, -low) > 0.5 * abs(limit):
            low, high = min(low, limit), max(high, limit)
    margin = _MARGINS * (high - low) or 1.0
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


def numbers(values: np.ndarray, digits: int = _DIGITS) -> list[float | None]:
    """Numbers for JSON, which has no infinity; more digits than a screen resolves."""
    return [float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in values.tolist()]


def times(values: np.ndarray) -> list[float | None]:
    """Times for JSON."""
    return numbers(values, _DIGITS_OF_TIMES)
