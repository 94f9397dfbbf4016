"""Any signals of any results over time."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestrator.analysis.figures.panels import over_time
from orchestrator.analysis.figures.signal import draw_signal
from orchestrator.analysis.figures.style import COLOURS, STYLES, WIDTH, Drawn, plain, styled
from orchestrator.analysis.signals import unit_of
from orchestrator.errors import InputError
from orchestrator.master.selection import matches, matching
from orchestrator.master.table import Table

#: What is drawn where nothing is asked for, as far as it is there.
DEFAULT = ("controller.e", "plant.tau", "controller.theta_hat")

#: Height of a panel, and of what stands above and below all of them [in].
_PANEL, _MARGIN = 1.9, 0.6

#: Entries in a row of a legend.
_COLUMNS = 6


class Plot(Figure):
    """A figure that a notebook shows by itself."""

    def _repr_png_(self) -> bytes:
        image = BytesIO()
        self.savefig(image, format="png")
        return image.getvalue()


def wanted(columns: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """The columns of a table that would be drawn."""
    return [name for name in columns if any(matches(name, p) for p in patterns or DEFAULT)]


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
        patterns = [pattern for pattern in DEFAULT if wanted(names, [pattern])]
    if not patterns:
        groups = dict.fromkeys(map(group_of, names))
        raise InputError(f"name the columns to draw; there are {', '.join(groups)}")
    panels: dict[tuple[str, str], list[str]] = {}
    for name in matching(names, patterns):
        panels.setdefault((group_of(name), unit_of(name)), []).append(name)
    with styled():
        figure = Plot(figsize=(WIDTH, _MARGIN + _PANEL * len(panels)))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        has_means = [
            _draw_panel(place, group, unit, members, runs)
            for place, ((group, unit), members) in zip(axes, panels.items(), strict=True)
        ]
        over_time(list(axes), [Drawn(*run) for run in runs], any(has_means))
    return figure


def group_of(column: str) -> str:
    """The group that a column belongs to: plant.y of plant.y.x; the column itself for others."""
    for separator in ("[", "."):
        group, _, member = column.rpartition(separator)
        if "." in group and member:
            return group
    return column


def _column(name: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    return table.time, table[name]


def _draw_panel(
    axes: Axes, group: str, unit: str, members: Sequence[str], runs: Sequence[tuple[str, Table]]
) -> bool:
    """The lines of a group; whether there are means among them.

    Members differ in colour, runs in style; runs of a single member in both.
    """
    has_means = False
    for i, (run, table) in enumerate(runs):
        for j, member in enumerate(members):
            if member not in table:
                continue
            part = member.removeprefix(group).strip(".[]")
            texts = [part] * (len(members) > 1) + [plain(run)] * (len(runs) > 1)
            colour = (j if len(members) > 1 else i) % len(COLOURS)
            style = (i if len(runs) > 1 else j) % len(STYLES)
            has_means |= draw_signal(
                axes,
                table,
                partial(_column, member),
                color=COLOURS[colour],
                linestyle=STYLES[style],
                label=", ".join(texts),
            )
    name = group if len(members) > 1 else members[0]
    axes.set_ylabel(f"{name}\n[{unit}]" if unit else name)
    if len(members) * len(runs) > 1:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=_COLUMNS)
    return has_means
