"""Figures of runs, drawn from their tables of values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestrator.analysis.signals import (
    ACTUATORS,
    AXES,
    COMMANDED,
    ELL,
    LIMITS,
    NU,
    POSTURE,
    THETA_HAT,
    Y_D,
    parameter,
    tracking_error,
    true_control_point,
)
from orchestrator.master.table import Table

#: Okabe and Ito's colours, which stay apart for colour-blind eyes, darkest first; every line
#: also has a style of its own, for print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
STYLES = ("-", "--", "-.", ":")
_REFERENCE = "#555555"

#: Width of lines that carry measurement noise or chatter.
_NOISY = 0.6

_ACTUATOR_LABELS = (r"$\tau_u$ [N]", r"$\tau_q$ [N·m]", r"$\tau_r$ [N·m]")

SETTINGS: Any = {
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


class Drawn(NamedTuple):
    """A run in a figure."""

    label: str
    result: Table


def draw(kind: str, title: str, runs: Sequence[Drawn], folder: Path, stem: str) -> list[str]:
    """Draw the figures of a scenario, as PNG and SVG, as far as the runs have what they show.

    Args:
        kind: key of :data:`FIGURES`.
        title: heading.
        runs: the run of the scenario, and those it is compared with.
        folder: to write into.
        stem: of the file names.

    Returns:
        What was left out, and why.

    """
    for run in runs:
        if missing := missing_for(kind, run.result):
            return [f"no figure: the run has no {missing[0]}"]
    # A title is text, and no formula.
    title = title.replace("$", r"\$")
    with mpl.rc_context(SETTINGS):
        for suffix, figure in FIGURES[kind](title, runs).items():
            for ending in ("png", "svg"):
                save(figure, folder / f"{stem}{suffix}.{ending}")
    return []


def save(figure: Figure, path: Path) -> None:
    """Write a figure without the time and the tool, so that the same run gives the same file."""
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else {"Software": None})


def missing_for(kind: str, result: Table) -> list[str]:
    """Ports and parameters that a run lacks for a figure: a user's own system may have others."""
    needed = [*POSTURE, *NU, *COMMANDED]
    if not kind.startswith("open-loop"):
        needed += [*Y_D, *THETA_HAT]
    return result.missing(needed, [ELL, *LIMITS]) or ["step"] * (len(result) < 2)


def _tracking(title: str, runs: Sequence[Drawn]) -> dict[str, Figure]:
    """The four panels of Fig. 4, and the estimated velocity."""
    result = runs[0].result
    figure = Figure(figsize=(11, 8))
    figure.suptitle(title)
    path, errors, controls, estimates = (
        figure.add_subplot(2, 2, 1, projection="3d"),
        figure.add_subplot(2, 2, 2),
        figure.add_subplot(2, 2, 3),
        figure.add_subplot(2, 2, 4),
    )
    draw_path(path, [Drawn("control point $y$", result)])
    draw_lines(errors, result.time, tracking_error(result), [f"$e_{k}$" for k in AXES])
    errors.set(title="tracking errors", ylabel="error [m]")
    _draw_controls(controls, result)
    controls.set_title("commanded control signals")
    theta_hat = result.group(*(f"controller.theta_hat[{i}]" for i in range(1, 5)))
    units = ("N", "kg/s", "kg/m", "kg")
    labels = [rf"$\hat{{\theta}}_{i}$ [{unit}]" for i, unit in enumerate(units, start=1)]
    draw_lines(estimates, result.time, theta_hat, labels)
    estimates.set(title="estimated parameters", ylabel="estimate, units in the legend")
    figures = {"": figure}
    if "controller.dy_hat.x" in result:
        figures["-velocity"] = _velocity(title, result)
    return figures


def draw_path(axes: Any, runs: Sequence[Drawn]) -> None:
    """Paths of control points and their reference in three dimensions, depth downwards."""
    reference = runs[0].result
    if "planner.y_d.x" in reference:
        y_d = reference.group(*(f"planner.y_d.{k}" for k in AXES))
        axes.plot(*y_d.T, color=_REFERENCE, linestyle="--", label="reference $y_d$")
        axes.scatter(*y_d[0], color=_REFERENCE, marker="s", label="its start")
    for run, colour, style in zip(runs, COLOURS, ("-", "-."), strict=False):
        y = true_control_point(run.result)
        axes.plot(*y.T, color=colour, linestyle=style, label=run.label)
        axes.scatter(*y[0], color=colour, marker="o")
    axes.set(xlabel="x north [m]", ylabel="y east [m]", zlabel="z down [m]")
    axes.invert_zaxis()
    axes.invert_yaxis()
    for name in "xyz":
        axes.locator_params(axis=name, nbins=5)
    axes.legend(loc="lower left", bbox_to_anchor=(-0.15, 0.95), ncols=2, fontsize="small")


def draw_lines(
    axes: Axes,
    time: np.ndarray,
    values: np.ndarray,
    labels: Sequence[str],
    width: float | None = None,
) -> None:
    """One line for each column of values, over time."""
    for column, label, colour, style in zip(values.T, labels, COLOURS, STYLES, strict=False):
        axes.plot(time, column, color=colour, linestyle=style, linewidth=width, label=label)
    axes.set_xlabel("time [s]")
    axes.margins(x=0)
    axes.legend(ncols=len(labels), fontsize="small")


def _limits(result: Table, k: str) -> tuple[float, float]:
    lower, upper = (parameter(result, f"plant.{limit}.{k}") for limit in ("tau_min", "tau_max"))
    return lower, upper


def _draw_controls(axes: Axes, result: Table) -> None:
    commands = result.group(*(f"plant.tau.{k}" for k in ACTUATORS))
    # A row holds the command of the step that ends there: drawn from where it began.
    draw_lines(axes, result.time[:-1], commands[1:], _ACTUATOR_LABELS, _NOISY)
    limits = {limit for k in ACTUATORS for limit in _limits(result, k)}
    for i, limit in enumerate(sorted(limits)):
        axes.axhline(limit, color="black", linewidth=1, label=None if i else "limits of (3)")
    axes.set_ylabel("force [N], moment [N·m]")
    axes.margins(y=0.12)
    axes.legend(ncols=4, fontsize="small", loc="lower right", bbox_to_anchor=(1, 0.08))


def _velocity(title: str, result: Table) -> Figure:
    """True and estimated velocity of the control point, and their difference."""
    # The controller's row holds what it estimated at the beginning of the step.
    time = result.time[:-1]
    true = result.group(*(f"plant.dy.{k}" for k in AXES))[:-1]
    estimated = result.group(*(f"controller.dy_hat.{k}" for k in AXES))[1:]
    figure = Figure(figsize=(11, 8))
    figure.suptitle(f"{title}\nVelocity of the control point, true and estimated")
    panels = figure.subplots(4, 1, sharex=True)
    for k, axes, truth, estimate in zip(AXES, panels, true.T, estimated.T, strict=False):
        axes.plot(time, estimate, color=COLOURS[1], linewidth=_NOISY, label="estimated")
        axes.plot(time, truth, color=COLOURS[0], linestyle="--", label="true, never measured")
        axes.set_ylabel(rf"$\dot{{y}}_{k}$ [m/s]")
        axes.margins(x=0)
    panels[0].legend(ncols=2, fontsize="small")
    draw_lines(panels[3], time, estimated - true, [f"${k}$" for k in AXES], _NOISY)
    panels[3].set_ylabel("difference [m/s]")
    return figure


def _acceleration(result: Table, *members: str) -> np.ndarray:
    """dnu/dt as the plant's Euler scheme has it: the difference over the step."""
    nu = result.group(*(f"plant.nu.{k}" for k in members))
    rate: np.ndarray = np.diff(nu, axis=0) / np.diff(result.time)[:, np.newaxis]
    return rate


def _open_loop_surge(title: str, runs: Sequence[Drawn]) -> dict[str, Figure]:
    """The panels of Fig. 3(a)."""
    result = runs[0].result
    figure = Figure(figsize=(13, 4.5))
    figure.suptitle(title)
    path = figure.add_subplot(1, 3, 1, projection="3d")
    draw_path(path, [Drawn("control point $y$", result)])
    velocity, acceleration = figure.add_subplot(1, 3, 2), figure.add_subplot(1, 3, 3)
    draw_lines(velocity, result.time, result.group("plant.nu.u"), ["$u$"])
    velocity.set(title="surge velocity", ylabel="velocity [m/s]")
    draw_lines(acceleration, result.time[:-1], _acceleration(result, "u"), [r"$\dot{u}$"])
    acceleration.set(title="surge acceleration", ylabel="acceleration [m/s²]")
    return {"": figure}


def _open_loop_turn(title: str, runs: Sequence[Drawn]) -> dict[str, Figure]:
    """The panels of Fig. 3(b)."""
    result = runs[0].result
    figure = Figure(figsize=(13, 8))
    figure.suptitle(title)
    path = figure.add_subplot(2, 3, 1, projection="3d")
    draw_path(path, [Drawn("control point $y$", result)])
    plan = figure.add_subplot(2, 3, 4)
    y = true_control_point(result)
    plan.plot(y[:, 1], y[:, 0], color=COLOURS[0])
    plan.set(title="from above", xlabel="y east [m]", ylabel="x north [m]", aspect="equal")
    for row, (members, unit) in enumerate((("uvw", "m/s"), ("pqr", "rad/s"))):
        velocity, acceleration = (figure.add_subplot(2, 3, 3 * row + column) for column in (2, 3))
        nu = result.group(*(f"plant.nu.{k}" for k in members))
        draw_lines(velocity, result.time, nu, [f"${k}$" for k in members])
        velocity.set(title="velocities", ylabel=f"velocity [{unit}]")
        rates = _acceleration(result, *members)
        labels = [rf"$\dot{{{k}}}$" for k in members]
        draw_lines(acceleration, result.time[:-1], rates, labels)
        acceleration.set(title="accelerations", ylabel=f"acceleration [{unit}²]")
    return {"": figure}


def draw_errors(linear: Sequence[Axes], logarithmic: Sequence[Axes], runs: Sequence[Drawn]) -> None:
    """Tracking errors of some runs, an axis a panel, in linear and logarithmic scale."""
    linear[0].set_title("tracking errors")
    logarithmic[0].set_title("tracking errors, logarithmic")
    for run, colour, style in zip(runs, COLOURS, STYLES, strict=False):
        errors = tracking_error(run.result)
        for k, a, b, error in zip(AXES, linear, logarithmic, errors.T, strict=True):
            line: Any = {"color": colour, "linestyle": style, "label": run.label, "linewidth": 1.0}
            a.plot(run.result.time, error, **line)
            b.semilogy(run.result.time, np.abs(error), **line)
            a.set_ylabel(f"$e_{k}$ [m]")
            b.set_ylabel(f"$|e_{k}|$ [m]")
            # Zero crossings reach far down and say nothing.
            b.set_ylim(bottom=1e-5)
    linear[0].legend(fontsize="small")
    for axes in (*linear, *logarithmic):
        axes.margins(x=0)
    for axes in (linear[-1], logarithmic[-1]):
        axes.set_xlabel("time [s]")


def draw_commands(panels: Sequence[Axes], runs: Sequence[Drawn]) -> None:
    """Commands of some runs, an actuator a panel; beyond the limits they are cut off."""
    panels[0].set_title("commanded control signals")
    for k, label, axes in zip(ACTUATORS, _ACTUATOR_LABELS, panels, strict=True):
        lower, upper = _limits(runs[0].result, k)
        # Drawn last to first, so that the run of the scenario lies on top.
        for run, colour in reversed(list(zip(runs, COLOURS, strict=False))):
            command = run.result[f"plant.tau.{k}"][1:]
            axes.plot(
                run.result.time[:-1], command, color=colour, linewidth=_NOISY, label=run.label
            )
        for limit in (lower, upper):
            axes.axhline(limit, color="black", linewidth=1)
        axes.set(ylabel=label, ylim=(1.5 * lower, 1.5 * upper))
        axes.margins(x=0)
    panels[0].legend(fontsize="small", ncols=2)
    panels[-1].set_xlabel("time [s]")


def _comparison(title: str, runs: Sequence[Drawn]) -> dict[str, Figure]:
    """The panels of Fig. 5: paths, errors in both scales, control signals."""
    figure = Figure(figsize=(17, 8))
    figure.suptitle(title)
    grid = figure.add_gridspec(3, 4, width_ratios=(1.3, 1, 1, 1))
    path = figure.add_subplot(grid[:, 0], projection="3d")
    draw_path(path, runs)
    linear, logarithmic, controls = (
        [figure.add_subplot(grid[row, column]) for row in range(3)] for column in (1, 2, 3)
    )
    draw_errors(linear, logarithmic, runs)
    draw_commands(controls, runs)
    return {"": figure}


def _comparison_errors(title: str, runs: Sequence[Drawn]) -> dict[str, Figure]:
    """Fig. 6: errors in both scales; the paper leaves out the control signals."""
    figure = Figure(figsize=(11, 8))
    figure.suptitle(title)
    panels = figure.subplots(3, 2, sharex=True)
    draw_errors(panels[:, 0], panels[:, 1], runs)
    return {"": figure}


#: Figures by the name that scenarios select them with.
FIGURES: dict[str, Callable[[str, Sequence[Drawn]], dict[str, Figure]]] = {
    "tracking": _tracking,
    "open-loop-surge": _open_loop_surge,
    "open-loop-turn": _open_loop_turn,
    "comparison": _comparison,
    "comparison-errors": _comparison_errors,
}
