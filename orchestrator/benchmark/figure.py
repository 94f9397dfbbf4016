"""The figure of the benchmark: errors of all laws, by vehicle and task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure

from orchestrator.benchmark.contest import Law, Vehicle
from orchestrator.benchmark.table import ALL, Made, lines, quantiles
from orchestrator.figures.drawing import styled
from orchestrator.figures.style import FIGURE_WIDTH, vehicle_colours

#: Height of a panel and of the space around all [in], width of the group of a task, and markers.
_PANEL, _AROUND, _GROUP, _MARKERS = 1.9, 1.3, 0.8, "osD^vPX*hd"


def draw(
    made: Made, laws: Mapping[str, Law], vehicles: Mapping[str, Vehicle], tasks: Sequence[str]
) -> Figure:
    """Draw medians and bands of late errors, a panel for each vehicle; the best law first."""
    ranked = [line.law for line in lines(made, [*laws], [*vehicles], ALL)]
    colours = vehicle_colours(len(ranked))
    with styled():
        size = FIGURE_WIDTH, _PANEL * len(vehicles) + _AROUND
        figure, panels = pyplot.subplots(
            len(vehicles), sharex=True, squeeze=False, figsize=size, layout="constrained"
        )
        for panel, vehicle in zip(panels[:, 0], vehicles.values(), strict=True):
            for place, (law, colour) in enumerate(zip(ranked, colours, strict=True)):
                runs = made[law, vehicle.name]
                errors = np.nan_to_num(runs.columns["error"], nan=np.inf)
                bands = np.array([quantiles(errors[runs.tasks.index(task)]) for task in tasks])
                middle, low, high = np.where(np.isfinite(bands), bands, np.nan).T
                shift = _GROUP * ((place + 0.5) / len(ranked) - 0.5)
                panel.errorbar(
                    np.arange(len(tasks)) + shift,
                    middle,
                    [middle - low, high - middle],
                    fmt=_MARKERS[place % len(_MARKERS)],
                    color=colour,
                    markersize=4,
                    linewidth=1.0,
                    label=laws[law].label,
                )
            panel.grid(visible=False, axis="x")
            panel.set_yscale("log")
            panel.set_ylabel("late error [m]")
            panel.set_title(vehicle.scenario.label)
            for edge in np.arange(1, len(tasks)) - 0.5:
                panel.axvline(edge, color="lightgrey", linewidth=0.8)
        panels[-1, 0].set_xticks(range(len(tasks)), [task.replace("_", " ") for task in tasks])
        panels[-1, 0].set_xlim(-0.5, len(tasks) - 0.5)
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        pyplot.close(figure)
    return figure
