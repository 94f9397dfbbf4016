"""Figures of a run, drawn from its table of values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestrator.metrics import ACTUATORS, AXES, tracking_error, true_control_point
from orchestrator.result import Result
from orchestrator.system import PortName

#: Okabe and Ito's colours, which stay apart for colour-blind eyes, darkest first; every line
#: also has a style of its own, for print.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_STYLES = ("-", "--", "-.", ":")
_REFERENCE = "#555555"

#: Width of lines that carry measurement noise.
_NOISY = 0.6

_SETTINGS: Any = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.w_pad": 0.15,
    "font.size": 10,
    "grid.alpha": 0.3,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.9,
    "lines.linewidth": 1.5,
    "savefig.dpi": 150,
    # Figures of the same run are the same file.
    "svg.hashsalt": "auv-fmu",
}


def draw(kind: str, title: str, result: Result, folder: Path, stem: str) -> list[Path]:
    """Draw the figures of a scenario, as PNG and SVG.

    Args:
        kind: key of :data:`FIGURES`.
        title: heading.
        result: of the run.
        folder: to write into.
        stem: of the file names.

    Returns:
        The files written.

    """
    written = []
    with mpl.rc_context(_SETTINGS):
        for suffix, figure in FIGURES[kind](title, result).items():
            for ending in ("png", "svg"):
                path = folder / f"{stem}{suffix}.{ending}"
                metadata = {"Date": None} if ending == "svg" else {"Software": None}
                figure.savefig(path, metadata=metadata)
                written.append(path)
    return written


def _tracking(title: str, result: Result) -> dict[str, Figure]:
    """The four panels of Fig. 4, and the estimated velocity."""
    figure = Figure(figsize=(11, 8))
    figure.suptitle(title)
    path, errors, controls, estimates = (
        figure.add_subplot(2, 2, 1, projection="3d"),
        figure.add_subplot(2, 2, 2),
        figure.add_subplot(2, 2, 3),
        figure.add_subplot(2, 2, 4),
    )
    _draw_path(path, result)
    path.set_title("(a) control point and reference")
    _draw_lines(errors, result.time, tracking_error(result), [f"$e_{k}$" for k in AXES])
    errors.set(title="(b) tracking errors", ylabel="error [m]")
    _draw_controls(controls, result)
    controls.set_title("(c) commanded control signals")
    theta_hat = result.group(*(f"controller.theta_hat[{i}]" for i in range(1, 5)))
    units = ("N", "kg/s", "kg/m", "kg")
    labels = [rf"$\hat{{\theta}}_{i}$ [{unit}]" for i, unit in enumerate(units, start=1)]
    _draw_lines(estimates, result.time, theta_hat, labels)
    estimates.set(title="(d) estimated parameters", ylabel="estimate, units in the legend")
    return {"": figure, "-velocity": _velocity(title, result)}


def _draw_path(axes: Any, result: Result) -> None:
    y, y_d = true_control_point(result), result.group(*(f"planner.y_d.{k}" for k in AXES))
    axes.plot(*y_d.T, color=_REFERENCE, linestyle="--", label="reference $y_d$")
    axes.plot(*y.T, color=_COLOURS[0], label="control point $y$")
    axes.scatter(*y[0], color=_COLOURS[0], marker="o", label="start of the vehicle")
    axes.scatter(*y_d[0], color=_REFERENCE, marker="s", label="start of the reference")
    axes.set(xlabel="x north [m]", ylabel="y east [m]", zlabel="z down [m]")
    axes.invert_zaxis()
    axes.invert_yaxis()
    axes.legend(loc="upper left", bbox_to_anchor=(-0.45, 1.0), fontsize="small")


def _draw_lines(
    axes: Axes,
    time: np.ndarray,
    values: np.ndarray,
    labels: Sequence[str],
    width: float | None = None,
) -> None:
    for column, label, colour, style in zip(values.T, labels, _COLOURS, _STYLES, strict=False):
        axes.plot(time, column, color=colour, linestyle=style, linewidth=width, label=label)
    axes.set_xlabel("time [s]")
    axes.margins(x=0)
    axes.legend(ncols=len(labels), fontsize="small")


def _draw_controls(axes: Axes, result: Result) -> None:
    labels = (r"$\tau_u$ [N]", r"$\tau_q$ [N·m]", r"$\tau_r$ [N·m]")
    commands = result.group(*(f"plant.tau.{k}" for k in ACTUATORS))
    # A row holds the command of the step that ends there: drawn from where it began.
    _draw_lines(axes, result.time[:-1], commands[1:], labels, _NOISY)
    limits = {
        result.parameters[PortName("plant", f"{limit}.{k}")]
        for limit in ("tau_min", "tau_max")
        for k in ACTUATORS
    }
    for i, limit in enumerate(sorted(limits)):
        axes.axhline(limit, color="black", linewidth=1, label=None if i else "limits of (3)")
    axes.set_ylabel("force [N], moment [N·m]")
    axes.margins(y=0.12)
    axes.legend(ncols=4, fontsize="small", loc="lower right", bbox_to_anchor=(1, 0.08))


def _velocity(title: str, result: Result) -> Figure:
    """True and estimated velocity of the control point, and their difference."""
    # The controller's row holds what it estimated at the beginning of the step.
    time = result.time[:-1]
    true = result.group(*(f"plant.dy.{k}" for k in AXES))[:-1]
    estimated = result.group(*(f"controller.dy_hat.{k}" for k in AXES))[1:]
    figure = Figure(figsize=(11, 8))
    figure.suptitle(f"{title}\nVelocity of the control point, true and estimated")
    panels = figure.subplots(4, 1, sharex=True)
    for k, axes, truth, estimate in zip(AXES, panels, true.T, estimated.T, strict=False):
        axes.plot(
            time, estimate, color=_COLOURS[1], linewidth=_NOISY, label="estimated, the observer"
        )
        axes.plot(time, truth, color=_COLOURS[0], linestyle="--", label="true, never measured")
        axes.set_ylabel(rf"$\dot{{y}}_{k}$ [m/s]")
        axes.margins(x=0)
    panels[0].legend(ncols=2, fontsize="small")
    labels = [f"${k}$" for k in AXES]
    _draw_lines(panels[3], time, estimated - true, labels, _NOISY)
    panels[3].set_ylabel("difference [m/s]")
    return figure


#: Figures by the name that scenarios select them with.
FIGURES: dict[str, Callable[[str, Result], dict[str, Figure]]] = {"tracking": _tracking}
