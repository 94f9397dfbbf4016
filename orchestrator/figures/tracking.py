"""Figs. 4 and 7: one run, and thin and black its twin, say without noise."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from orchestrator.figures.layout import Cell, Panel, Rows
from orchestrator.figures.panels import COMMANDS, PATH, over_time, title
from orchestrator.figures.signal import draw_signal
from orchestrator.figures.style import COLOURS, STYLES, Drawn, having, plain
from orchestrator.master.observers.table import Table
from orchestrator.vehicle import signals
from orchestrator.vehicle.signals import AXES, DY, DY_HAT, THETA_HAT, THETA_UNITS, tracking_error


def draw_lines(
    axes: Axes, time: np.ndarray, values: np.ndarray, labels: Sequence[str], twin: str | None = None
) -> None:
    """One line for each column of values.

    Args:
        axes: to draw into.
        time: of the rows of values [s].
        values: (rows, lines).
        labels: of the lines.
        twin: the name of a run whose lines are thin and black; None: the run itself.

    """
    for i, (column, label) in enumerate(zip(values.T, labels, strict=True)):
        if twin is None:
            line: Any = {"color": COLOURS[i], "linestyle": STYLES[i], "label": label}
        else:
            line = {"color": "black", "linewidth": 0.7, "label": None if i else plain(twin)}
        axes.plot(time, column, **line)


def _errors(cell: Cell, runs: Sequence[Drawn]) -> None:
    axes = cell.axes()
    for i, (run, _) in enumerate(having(runs, signals.TRACKING)):
        twin = run.label if i else None
        labels = [f"$e_{k}$" for k in AXES]
        draw_lines(axes, run.result.time, tracking_error(run.result), labels, twin)
    axes.set_ylabel("error [m]")
    title(axes, "tracking errors")
    over_time([axes], runs)


def _estimates(cell: Cell, runs: Sequence[Drawn]) -> None:
    axes = cell.axes()
    labels = [rf"$\hat{{\theta}}_{i}$ [{unit}]" for i, unit in enumerate(THETA_UNITS, start=1)]
    for i, (run, _) in enumerate(having(runs, (THETA_HAT, ()))):
        estimates = run.result.step_values(*THETA_HAT)
        draw_lines(axes, run.result.step_start, estimates, labels, run.label if i else None)
    axes.set_ylabel("estimate")
    title(axes, "estimated parameters")
    over_time([axes], runs)


def _velocity(cell: Cell, runs: Sequence[Drawn]) -> None:
    """True and estimated velocity of the control point."""
    run, _ = next(having(runs, (DY_HAT, ())))
    time, true = run.result.step_start, run.result.start_values(*DY)
    panels = cell.stack(3)
    has_means = False
    for k, axes, truth, column in zip(AXES, panels, true.T, DY_HAT, strict=True):
        estimate = partial(_estimated, column)
        has_means |= draw_signal(axes, run.result, estimate, color=COLOURS[1], label="estimated")
        axes.plot(time, truth, color=COLOURS[0], linestyle="--", label="true, never measured")
        axes.set_ylabel(rf"$\dot{{y}}_{k}$ [m/s]")
    title(panels[0], "velocity of the control point")
    over_time(panels, [run], has_means)


def _velocity_errors(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Estimated less true velocity of the control point."""
    run, _ = next(having(runs, (DY_HAT, ())))
    panels = cell.stack(3)
    has_means = False
    for k, axes, estimate, truth in zip(AXES, panels, DY_HAT, DY, strict=True):
        error = partial(_velocity_error, estimate, truth)
        has_means |= draw_signal(axes, run.result, error, color=COLOURS[1])
        axes.set_ylabel(rf"$\Delta \dot{{y}}_{k}$ [m/s]")
    title(panels[0], "estimated less true")
    over_time(panels, [run], has_means)


def _estimated(column: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    return table.step_start, table.step_values(column)[:, 0]


def _velocity_error(estimate: str, truth: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    time, estimated = _estimated(estimate, table)
    return time, estimated - table.start_values(truth)[:, 0]


ERRORS = Panel("tracking errors", signals.TRACKING, _errors, 3.4)
ESTIMATES = Panel("estimated parameters", (THETA_HAT, ()), _estimates, 3.6)
_VELOCITIES = ((*DY, *DY_HAT), ())
VELOCITY = Panel("estimated velocity", _VELOCITIES, _velocity, 4.6)
VELOCITY_ERRORS = Panel("error of the estimated velocity", _VELOCITIES, _velocity_errors, 4.6)

TRACKING: dict[str, Rows] = {
    "": ((PATH, ERRORS), (COMMANDS, ESTIMATES)),
    "-velocity": ((VELOCITY, VELOCITY_ERRORS),),
}
