"""Any signals of any results over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from orchestrator.figures.drawing import Plot, legend_columns, name_lines, styled
from orchestrator.figures.event_marks import list_events
from orchestrator.figures.panels import over_time
from orchestrator.figures.style import (
    COLOURS,
    FIGURE_WIDTH,
    STYLES,
    Drawn,
    escape_math,
    printed_unit,
)
from orchestrator.figures.visible import draw_signal
from orchestrator.machine.errors import InputError
from orchestrator.master.observers.observer import matches, matching
from orchestrator.master.observers.table import Table
from orchestrator.system.names import PortName

#: What is drawn where nothing is asked for, as far as it is there.
DEFAULT_PATTERNS = ("controller.e", "plant.tau", "controller.theta_hat")

#: Height of a panel, and of what stands above and below all of them [in].
_PANEL, _MARGIN = 1.9, 0.6

#: Runs of one scenario are told apart by so many parameters.
_FEW = 2

#: Of the lines, so many that few runs look alike.
_STYLES = (*STYLES, (0, (7, 2)), (0, (3, 1, 1, 1, 1, 1)))


def wanted_columns(columns: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The columns of a table that would be drawn."""
    return [name for name in columns if any(matches(name, p) for p in patterns or DEFAULT_PATTERNS)]


def plot(runs: Sequence[tuple[str, Table]], patterns: Sequence[str] = ()) -> Figure:
    """Draw columns over time, a group such as plant.y a panel, runs over each other.

    Args:
        runs: labels and tables.
        patterns: such as `plant.y.*`, or the name of a group or column; none: errors, commands
            and estimates of the loop.

    Raises:
        InputError: a pattern matches no column.

    """
    if not all(isinstance(pattern, str) for pattern in patterns):
        raise InputError(f"patterns are texts such as plant.y.*, not {list(patterns)!r}")
    names = list(dict.fromkeys(name for _, table in runs for name in table.columns))
    if not patterns:
        patterns = [pattern for pattern in DEFAULT_PATTERNS if wanted_columns(names, [pattern])]
    if not patterns:
        groups = dict.fromkeys(map(group_of, names))
        raise InputError(f"name the columns to draw; there are {', '.join(groups)}")
    units = {name: unit for _, table in runs for name, unit in table.header.units.items()}
    panels: dict[tuple[str, str], list[str]] = {}
    for name in matching(names, patterns):
        # The members of a vector share a panel, whatever their units.
        unit = "" if name.endswith("]") else printed_unit(units.get(name, ""))
        panels.setdefault((group_of(name), unit), []).append(name)
    with styled():
        figure = Plot(figsize=(FIGURE_WIDTH, _MARGIN + _PANEL * len(panels)))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        has_means = [
            _draw_panel(place, group, unit, members, runs)
            for place, ((group, unit), members) in zip(axes, panels.items(), strict=True)
        ]
        drawn = [Drawn(*run) for run in runs]
        over_time(list(axes), drawn, any(has_means))
        list_events(figure, drawn)
        if len(runs) > 1:
            in_colour = all(len(members) == 1 for members in panels.values())
            lines = [
                _line(label, COLOURS[i % len(COLOURS)] if in_colour else "black", i)
                for i, (label, _) in enumerate(runs)
            ]
            name_lines(figure, lines)
    return figure


def told_apart(runs: Sequence[Drawn], paths: Sequence[Path] = ()) -> list[str]:
    """What tells runs apart: scenarios, or a few parameters, or ends of paths, or else numbers.

    Args:
        runs: that are drawn together.
        paths: they were read from.

    """
    names = [run.label for run in runs]
    given = [run.result.header.parameters for run in runs]
    differing = [
        name
        for name in dict.fromkeys(name for values in given for name in values)
        if len({str(values.get(name)) for values in given}) > 1
    ]
    changes = [
        ", ".join([name] * (len(set(names)) > 1) + [f"{k} = {_text(values, k)}" for k in differing])
        for name, values in zip(names, given, strict=True)
    ]
    parts = [path.resolve().parts for path in paths]
    longest = max(map(len, parts), default=1)
    ends = [["/".join(part[-n:]) for part in parts] for n in range(1, longest)]
    numbered = [f"{name} ({number})" for number, name in enumerate(names, start=1)]
    candidates = [names, *([changes] * (len(differing) <= _FEW)), *ends, numbered]
    return next(labels for labels in candidates if len(set(labels)) == len(labels))


def _text(values: Mapping[PortName, Any], name: PortName) -> str:
    value = values.get(name, "none")
    return f"{value:g}" if isinstance(value, float) else str(value)


def group_of(column: str) -> str:
    """The group that a column belongs to: plant.y of plant.y.x; the column itself for others."""
    for separator in ("[", "."):
        group, _, member = column.rpartition(separator)
        if "." in group and member:
            return group
    return column


def _column(name: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    time, values = table.time, table[name]
    if table.header.units.get(name) == "rad":
        # An angle that wraps has a gap: a line across the panel would be no motion.
        wraps = 1 + np.flatnonzero(np.abs(np.diff(values)) > np.pi)
        time, values = np.insert(time, wraps, np.nan), np.insert(values, wraps, np.nan)
    return time, values


def _draw_panel(
    axes: Axes, group: str, unit: str, members: Sequence[str], runs: Sequence[tuple[str, Table]]
) -> bool:
    """The lines of a group; whether there are means among them.

    Members differ in colour, runs in style; runs of a single member in both.
    """
    has_means = False
    parts = [member.removeprefix(group).strip(".[]") for member in members]
    for i, (run, table) in enumerate(runs):
        for j, member in enumerate(members):
            if member not in table:
                continue
            colour = (j if len(members) > 1 else i) % len(COLOURS)
            has_means |= draw_signal(
                axes,
                table,
                partial(_column, member),
                color=COLOURS[colour],
                linestyle=_style(i if len(runs) > 1 else j),
                label=", ".join(
                    [parts[j]] * (len(members) > 1) + [escape_math(run)] * (len(runs) > 1)
                ),
            )
    name = group if len(members) > 1 else members[0]
    axes.set_ylabel(f"{name}\n[{unit}]" if unit else name)
    if len(members) > 1:
        lines = [
            _line(part, COLOURS[j % len(COLOURS)], 0 if len(runs) > 1 else j)
            for j, part in enumerate(parts)
        ]
        axes.legend(
            handles=lines, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=legend_columns(lines)
        )
    return has_means


def _line(label: str, colour: str, style: int) -> Line2D:
    """A line for a legend."""
    return Line2D([], [], color=colour, linestyle=_style(style), label=escape_math(label))


def _style(i: int) -> Any:
    return _STYLES[i % len(_STYLES)]
