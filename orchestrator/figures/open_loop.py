"""Fig. 3: the vehicle alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orchestrator.figures.layout import Cell, Panel, Rows
from orchestrator.figures.panels import PATH, over_time, title
from orchestrator.figures.style import Drawn, earth_axes, having
from orchestrator.figures.tracking import draw_lines
from orchestrator.vehicle.signals import CONTROL_POINT, NU, true_control_point


def _velocity(name: str, columns: Sequence[str], unit: str) -> Panel:
    def draw(cell: Cell, runs: Sequence[Drawn]) -> None:
        axes = cell.axes(ylabel=f"velocity [{unit}]")
        run, _ = next(having(runs, (columns, ())))
        labels = [f"${column[-1]}$" for column in columns]
        draw_lines(axes, run.result.time, run.result.group(*columns), labels)
        title(axes, name)
        over_time([axes], [run])

    return Panel(name, (columns, ()), draw)


def _acceleration(name: str, columns: Sequence[str], unit: str) -> Panel:
    """D nu/dt as the plant's Euler scheme has it: the difference over the step."""

    def draw(cell: Cell, runs: Sequence[Drawn]) -> None:
        axes = cell.axes(ylabel=f"acceleration [{unit}²]")
        run, _ = next(having(runs, (columns, ())))
        time, nu = run.result.time, run.result.group(*columns)
        rates = np.diff(nu, axis=0) / np.diff(time)[:, np.newaxis]
        labels = [rf"$\dot{{{column[-1]}}}$" for column in columns]
        draw_lines(axes, time[:-1], rates, labels)
        title(axes, name)
        over_time([axes], [run])

    return Panel(name, (columns, ()), draw)


def _from_above(cell: Cell, runs: Sequence[Drawn]) -> None:
    x, y, _ = earth_axes(runs[0].z_up)
    axes = cell.axes(xlabel=y, ylabel=x)
    axes.set_aspect("equal", adjustable="datalim")
    if runs[0].z_up:
        axes.invert_xaxis()
    for run, colour in having(runs, CONTROL_POINT):
        path = true_control_point(run.result)
        axes.plot(path[:, 1], path[:, 0], color=colour)
        axes.plot(path[0, 1], path[0, 0], "o", color=colour)
    title(axes, "path from above")


#: Fig. 3(a).
SURGE: dict[str, Rows] = {
    "": (
        (PATH,),
        (
            _velocity("surge velocity", NU[:1], "m/s"),
            _acceleration("surge acceleration", NU[:1], "m/s"),
        ),
    )
}

#: Fig. 3(b).
TURN: dict[str, Rows] = {
    "": (
        (PATH, Panel("path from above", CONTROL_POINT, _from_above)),
        (
            _velocity("linear velocities", NU[:3], "m/s"),
            _acceleration("linear accelerations", NU[:3], "m/s"),
        ),
        (
            _velocity("angular velocities", NU[3:], "rad/s"),
            _acceleration("angular accelerations", NU[3:], "rad/s"),
        ),
    )
}
