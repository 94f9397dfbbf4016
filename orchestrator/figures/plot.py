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

from orchestrator.cosim import Table
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
from orchestrator.machine.texts import matches, matching
from orchestrator.vehicle.signals import Loop

#: Height of a panel, and of what stands above and below all of them [in].
_PANEL, _MARGIN = 1.9, 0.6

#: Runs of one scenario are told apart by so many parameters, or events of each.
_FEW = 2

#: Of the lines, so many that few runs look alike.
_STYLES = (*STYLES, (0, (7, 2)), (0, (3, 1, 1, 1, 1, 1)))


def wanted_columns(
    columns: Sequence[str], loops: Sequence[Loop], patterns: Sequence[str]
) -> list[str]:
    """The columns of a table that would be drawn."""
    patterns = patterns or _usual(loops)
    return [name for name in columns if any(matches(name, pattern) for pattern in patterns)]


def _usual(loops: Sequence[Loop]) -> list[str]:
    """What is drawn where nothing is asked for, as far as it is there, of each vehicle."""
    return [
        pattern
        for loop in loops
        for pattern in (
            f"{loop.controller}.e",
            f"{loop.vehicle}.tau",
            f"{loop.controller}.theta_hat",
        )
    ]


def plot(runs: Sequence[Drawn], patterns: Sequence[str] = ()) -> Figure:
    """Draw columns over time, a group such as plant.y a panel, runs over each other.

    Args:
        runs: with labels that tell them apart.
        patterns: such as `plant.y.*`, or the name of a group or column; none: errors, commands
            and estimates of the loops of all vehicles.

    Raises:
        InputError: a pattern matches no column.

    """
    if not all(isinstance(pattern, str) for pattern in patterns):
        raise InputError(f"patterns are texts such as plant.y.*, not {list(patterns)!r}")
    names = list(dict.fromkeys(name for run in runs for name in run.result.header.numeric_columns))
    if not patterns:
        patterns = wanted_columns(names, [loop for run in runs for loop in run.loops], ())
    if not patterns:
        groups = dict.fromkeys(map(group_of, names))
        raise InputError(f"name the columns to draw; there are {', '.join(groups)}")
    units = {name: unit for run in runs for name, unit in run.result.header.units.items()}
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
        over_time(list(axes), runs, any(has_means))
        list_events(figure, runs)
        if len(runs) > 1:
            in_colour = all(len(members) == 1 for members in panels.values())
            lines = [
                _line(run.label, COLOURS[i % len(COLOURS)] if in_colour else "black", i)
                for i, run in enumerate(runs)
            ]
            name_lines(figure, lines)
    return figure


def told_apart(runs: Sequence[Drawn], paths: Sequence[Path] = ()) -> list[Drawn]:
    """Runs with labels that tell them apart.

    These are scenarios, or a few parameters, or a few events, or ends of paths, or else numbers.

    Args:
        runs: that are drawn together.
        paths: they were read from.

    """
    names = [run.label for run in runs]
    # A record does not say where a name is taken apart.
    given = [
        {str(name): value for name, value in run.result.header.parameters.items()} for run in runs
    ]
    differing = [
        name
        for name in dict.fromkeys(name for values in given for name in values)
        if len({str(values.get(name)) for values in given}) > 1
    ]
    changes = [
        ", ".join([name] * (len(set(names)) > 1) + [f"{k} = {_text(values, k)}" for k in differing])
        for name, values in zip(names, given, strict=True)
    ]
    happened = [
        [f"{one.label} at {one.time:.5g} s" for one in run.result.ending.events if one.label]
        for run in runs
    ]
    events = [
        ", ".join([name] * (len(set(names)) > 1) + (found or ["no event"]))
        for name, found in zip(names, happened, strict=True)
    ]
    parts = [path.resolve().parts for path in paths]
    longest = max(map(len, parts), default=1)
    ends = [["/".join(part[-n:]) for part in parts] for n in range(1, longest)]
    numbered = [f"{name} ({number})" for number, name in enumerate(names, start=1)]
    candidates = [
        names,
        *([changes] * (len(differing) <= _FEW)),
        *([events] * (max(map(len, happened)) <= _FEW)),
        *ends,
        numbered,
    ]
    labels = next(labels for labels in candidates if len(set(labels)) == len(labels))
    return [run._replace(label=label) for run, label in zip(runs, labels, strict=True)]


def _text(values: Mapping[str, Any], name: str) -> str:
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
    time, values = table.time, table[name].astype(float, copy=False)
    if table.header.units.get(name) == "rad":
        # An angle that wraps has a gap: a line across the panel would be no motion.
        wraps = 1 + np.flatnonzero(np.abs(np.diff(values)) > np.pi)
        time, values = np.insert(time, wraps, np.nan), np.insert(values, wraps, np.nan)
    return time, values


def _draw_panel(
    axes: Axes, group: str, unit: str, members: Sequence[str], runs: Sequence[Drawn]
) -> bool:
    """The lines of a group; whether there are means among them.

    Members differ in colour, runs in style; runs of a single member in both. A panel says which run
    is not in it.
    """
    has_means = False
    parts = [member.removeprefix(group).strip(".[]") for member in members]
    for i, run in enumerate(runs):
        for j, member in enumerate(members):
            if member not in run.result:
                continue
            colour = (j if len(members) > 1 else i) % len(COLOURS)
            has_means |= draw_signal(
                axes,
                run.result,
                partial(_column, member),
                color=COLOURS[colour],
                linestyle=_style(i if len(runs) > 1 else j),
                label=", ".join(
                    [parts[j]] * (len(members) > 1) + [escape_math(run.label)] * (len(runs) > 1)
                ),
            )
    lacking = [run.label for run in runs if not any(name in run.result for name in members)]
    if lacking:
        whose = escape_math(lacking[0]) if len(lacking) == 1 else f"{len(lacking)} of the runs"
        axes.set_title(f"not in {whose}", loc="right", fontsize="small")
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
