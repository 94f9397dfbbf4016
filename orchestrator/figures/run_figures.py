"""Figures of a run by the names that scenarios have for them; :mod:`.drawing` draws them.

A new one is an entry of :data:`FIGURES`, of the panels here and in :mod:`.panels`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from auv_fmu.language.quantities import NU, THETA
from orchestrator.cosim import Table
from orchestrator.figures import fleet_panels
from orchestrator.figures.panels import (
    COMMANDS,
    ERRORS,
    LOGARITHMIC_ERRORS,
    PATH,
    Cell,
    Panel,
    Rows,
    draw_all_errors,
    draw_lines,
    over_time,
    title,
)
from orchestrator.figures.style import (
    COLOURS,
    FIGURE_FORMATS,
    Drawn,
    earth_axes,
    printed_unit,
    runs_with,
)
from orchestrator.figures.visible import draw_signal
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.vehicle.signals import AXES, STANDARD, Loop, Needs, suffixes, true_control_point


def _all_errors(cell: Cell, runs: Sequence[Drawn]) -> None:
    axes = cell.axes()
    draw_all_errors(axes, runs)
    over_time([axes], runs)


def _estimates(cell: Cell, runs: Sequence[Drawn]) -> None:
    axes = cell.axes()
    labels = [rf"$\hat{{\theta}}_{i}$ [{unit}]" for i, unit in THETA.items()]
    for i, (run, _) in enumerate(runs_with(runs, Loop.for_parameter_estimates)):
        estimates = run.result.step_values(*run.loop.theta_hat)
        draw_lines(axes, run.result.step_start, estimates, labels, i)
    axes.set_ylabel("estimate")
    title(axes, "estimated parameters")
    over_time([axes], runs)


def _estimated_velocity(cell: Cell, runs: Sequence[Drawn]) -> None:
    """True and estimated velocity of the control point."""
    run, _ = next(runs_with(runs, Loop.for_velocity_estimates))
    time, true = run.result.step_start, run.result.start_values(*run.loop.dy)
    panels = cell.stack(3)
    has_means = False
    for k, axes, truth, column in zip(AXES, panels, true.T, run.loop.dy_hat, strict=True):
        estimate = partial(_estimated, column)
        has_means |= draw_signal(axes, run.result, estimate, color=COLOURS[1], label="estimated")
        axes.plot(time, truth, color=COLOURS[0], linestyle="--", label="true (not measured)")
        axes.set_ylabel(rf"$\dot{{y}}_{k}$ [m/s]")
    title(panels[0], "velocity of the control point")
    over_time(panels, runs, has_means)


def _velocity_errors(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Estimated velocity of the control point minus the true one."""
    run, _ = next(runs_with(runs, Loop.for_velocity_estimates))
    panels = cell.stack(3)
    has_means = False
    for k, axes, estimate, truth in zip(AXES, panels, run.loop.dy_hat, run.loop.dy, strict=True):
        error = partial(_velocity_error, estimate, truth)
        has_means |= draw_signal(axes, run.result, error, color=COLOURS[1])
        axes.set_ylabel(rf"$\Delta \dot{{y}}_{k}$ [m/s]")
    title(panels[0], "estimate - true")
    over_time(panels, runs, has_means)


def _estimated(column: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    return table.step_start, table.step_values(column)[:, 0]


def _velocity_error(estimate: str, truth: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    time, estimated = _estimated(estimate, table)
    return time, estimated - table.start_values(truth)[:, 0]


def _motion(name: str, directions: slice, is_rate: bool = False) -> Panel:
    """Velocities, or D nu/dt as the plant's Euler scheme has it: the difference over the step."""
    unit = printed_unit(list(NU.values())[directions][0])

    def needs(loop: Loop) -> Needs:
        return loop.nu[directions], ()

    def draw(cell: Cell, runs: Sequence[Drawn]) -> None:
        axes = cell.axes(ylabel=f"acceleration [{unit}²]" if is_rate else f"velocity [{unit}]")
        run, _ = next(runs_with(runs, needs))
        columns = run.loop.nu[directions]
        time, values = run.result.time, run.result.group(*columns)
        if is_rate:
            time, values = time[:-1], np.diff(values, axis=0) / np.diff(time)[:, np.newaxis]
        symbol = r"$\dot{{{}}}$" if is_rate else "${}$"
        draw_lines(axes, time, values, [symbol.format(column[-1]) for column in columns])
        title(axes, name)
        over_time([axes], runs)

    return Panel(name, needs, draw, of_one=True)


def _from_above(cell: Cell, runs: Sequence[Drawn]) -> None:
    x, y, _ = earth_axes(runs[0].z_up)
    axes = cell.axes(xlabel=y, ylabel=x)
    axes.set_aspect("equal", adjustable="datalim")
    if runs[0].z_up:
        axes.invert_xaxis()
    for run, colour in runs_with(runs, Loop.for_control_point):
        path = true_control_point(run.result, run.loop)
        axes.plot(path[:, 1], path[:, 0], color=colour)
        axes.plot(path[0, 1], path[0, 0], "o", color=colour)
    title(axes, "path from above")


ALL_ERRORS = Panel("tracking errors", Loop.for_tracking, _all_errors, 3.4)
ESTIMATES = Panel("estimated parameters", Loop.for_parameter_estimates, _estimates, 3.6)
VELOCITY = Panel("estimated velocity", Loop.for_velocity_estimates, _estimated_velocity, 4.6, True)
VELOCITY_ERRORS = Panel(
    "error of the estimated velocity", Loop.for_velocity_estimates, _velocity_errors, 4.6, True
)
FROM_ABOVE = Panel("path from above", Loop.for_control_point, _from_above)

_SURGE, _LINEAR, _ANGULAR = slice(1), slice(3), slice(3, None)

#: The figure of several vehicles together, and of how many each has its own besides.
FLEET, MOST_DRAWN = "fleet", 10

#: Rows of panels by what the names of their files end with, for each name.
FIGURES: Mapping[str, Mapping[str, Rows]] = {
    # Figs. 4 and 7: one run, and thin and black its twin, say without noise.
    "tracking": {
        "": ((PATH, ALL_ERRORS), (COMMANDS, ESTIMATES)),
        "-velocity": ((VELOCITY, VELOCITY_ERRORS),),
    },
    # Fig. 5.
    "comparison": {"": ((PATH, COMMANDS), (ERRORS, LOGARITHMIC_ERRORS))},
    # Fig. 6: the paper leaves out the control signals.
    "comparison-errors": {"": ((ERRORS, LOGARITHMIC_ERRORS),)},
    # Fig. 7 in one: any number of runs.
    "overlay": {"": ((ERRORS, COMMANDS),)},
    # Several vehicles together.
    FLEET: {
        "": (
            (fleet_panels.PATHS, fleet_panels.FROM_ABOVE),
            (fleet_panels.ERRORS, fleet_panels.DISTANCES),
        )
    },
    # Fig. 3(a): only the vehicle.
    "open-loop-surge": {
        "": (
            (PATH,),
            (_motion("surge velocity", _SURGE), _motion("surge acceleration", _SURGE, True)),
        )
    },
    # Fig. 3(b).
    "open-loop-turn": {
        "": (
            (PATH, FROM_ABOVE),
            (_motion("linear velocities", _LINEAR), _motion("linear accelerations", _LINEAR, True)),
            (
                _motion("angular velocities", _ANGULAR),
                _motion("angular accelerations", _ANGULAR, True),
            ),
        )
    },
}


def figures_of(key: str, loops: Sequence[Loop]) -> Iterator[tuple[str, str, Sequence[Loop]]]:
    """The figures of a run: of all vehicles together, and of each.

    Args:
        key: of :data:`FIGURES` that a single vehicle has.
        loops: of the vehicles.

    Yields:
        A key, what the names of the files go on with, and the loops that are drawn.

    """
    if len(loops) > 1 or key == FLEET:
        yield FLEET, "", loops
    if len(loops) <= MOST_DRAWN and key != FLEET:
        yield from ((key, vehicle, [loop]) for loop, vehicle in suffixes(loops).items())


def check_figure(key: str) -> None:
    """Check before a run that its figure is known.

    Raises:
        InputError: it is not.

    """
    if key not in FIGURES:
        hint = did_you_mean(key, FIGURES) or f"; there are {', '.join(FIGURES)}"
        raise InputError(f"no figure {key!r}{hint}")


def figure_files(key: str, stem: str, loops: Sequence[Loop] = (STANDARD,)) -> list[str]:
    """The files that :func:`.draw` may write.

    Args:
        key: of :data:`FIGURES`.
        stem: of their names.
        loops: of the vehicles.

    """
    return [
        f"{stem}{vehicle}{suffix}.{ending}"
        for of, vehicle, _ in figures_of(key, loops)
        for suffix in FIGURES[of]
        for ending in FIGURE_FORMATS
    ]
