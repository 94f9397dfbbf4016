"""Any signals of any results over time."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

from orchestrator.analysis.figures import COLOURS, SETTINGS, STYLES
from orchestrator.errors import InputError
from orchestrator.master.selection import matching
from orchestrator.master.table import Table


def plot(runs: Sequence[tuple[str, Table]], patterns: Sequence[str]) -> Figure:
    """Draw the columns that match some patterns, a panel a column, runs over each other.

    Args:
        runs: labels and tables.
        patterns: such as `plant.y.*`, or the name of a group or column.

    Raises:
        InputError: a pattern matches no column.

    """
    names = list(dict.fromkeys(name for _, table in runs for name in table.columns))
    if not patterns:
        raise InputError("name the columns to draw, such as plant.y.*")
    columns = matching(names, patterns)
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(10, 1 + 1.8 * len(columns)))
        panels = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
        for column, axes in zip(columns, panels, strict=True):
            for i, (label, table) in enumerate(runs):
                if column in table:
                    style = {
                        "color": COLOURS[i % len(COLOURS)],
                        "linestyle": STYLES[i % len(STYLES)],
                    }
                    axes.plot(table.time, table[column], label=label, **style)
            axes.set_ylabel(column)
            axes.margins(x=0)
        panels[-1].set_xlabel("time [s]")
        if len(runs) > 1:
            panels[0].legend()
    return figure
