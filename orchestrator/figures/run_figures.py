"""Figures of a run: their panels, and which panels make up the figure of each name.

A new figure is an entry of :data:`FIGURES`; :mod:`.drawing` draws it. Nothing here imports
matplotlib, which takes as long to import as everything else together: a panel fills axes that it
is given.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from auv_fmu.language.quantities import NU, TAU, THETA
from orchestrator.cosim import Table
from orchestrator.figures.style import (
    COLOURS,
    FIGURE_FORMATS,
    MARKS,
    REFERENCE,
    STYLES,
    Drawn,
    earth_axes,
    escape_math,
    printed_unit,
    runs_with,
    text_scale,
    vehicle_colours,
    widths_of_text,
)
from orchestrator.figures.visible import draw_signal, mean_window
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.vehicle.indices import (
    SMALLEST_DISTANCE_LABEL,
    distances,
    for_distances,
    size,
    smallest_distances,
)
from orchestrator.vehicle.signals import (
    ACTUATORS,
    AXES,
    STANDARD,
    Loop,
    Needs,
    limits,
    suffixes,
    tracking_error,
    true_control_point,
    waypoints,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec
    from matplotlib.transforms import Transform

#: Distance of the numbers of z from their axis, of the names of x and y from theirs, and what a
#: letter of their numbers adds to it, with texts of 10 pt; of the name of z from its axis [pt].
_Z_PAD, _BELOW, _LETTER, _ABOVE = 6, 16, 2, 4

#: Room for numbers and names around the box of a path, and for the legend above; least size of the
#: box; least size of a cell whose axes have more than a few numbers. With texts of 10 pt [in].
_AROUND_BOX, _LEGEND, _LEAST_BOX, _LARGE_CELL = (1.1, 0.6), 0.4, 0.5, 3.0

#: Least length of an axis of a path, as a share of the longest: a straight line gets a box.
_FLATTEST = 0.3

#: The limits of an actuator are in view if a command reaches this share of them.
_NEAR = 0.5

#: The axis of commands ends at this multiple of the limits; larger peaks are printed.
_BEYOND = 1.5

#: Lower end of a logarithmic axis of errors [m]: below it there are only zero crossings.
_SMALLEST_ERROR = 1e-5

#: Widths of the line of the first run and of the runs that it is compared with. The first of these
#: is solid, because a dashed line of an oscillating signal is a smear; the others have long dashes.
_THICK, _THIN = 1.4, 0.8
_LONG_DASHES: tuple[Any, ...] = ("-", (0, (8, 2)), (0, (8, 2, 2, 2)), (0, (8, 2, 2, 2, 2, 2)))

#: Peaks from here on are printed with an exponent [N, N.m].
_MANY = 1e6

#: Events that are marked per run, and times that are listed per event, at most.
_MOST_MARKS, _MOST_TIMES = 20, 4

#: Numbers of events closer together than this share of the time axis are stacked, this far [pt].
_CLOSE, _RISE = 0.04, 13

#: Characters in a line of the list of events, per size of text of its width, and height of a line
#: with texts of 10 pt [in].
_LETTERS, _LINE = 2.0, 0.16

#: Times at which lines join the vehicles of a fleet.
_INSTANTS = 9

#: Largest number of vehicles whose lines are labelled and whose pairs have a line each.
_MOST_NAMED = 4

#: Lines of a fleet: in the first run, and in the run that it is compared with.
_RUN_STYLES: tuple[dict[str, Any], ...] = (
    {"linewidth": 1.3},
    {"linewidth": 0.8, "linestyle": "--"},
)

#: Characters of a label that has room in the legend of a panel.
_SHORT = 16

#: Size of the marks of a few vehicles [pt], and how many a line has.
_MARK, _MARKS_ON_A_LINE = 3.5, 8


class Cell(NamedTuple):
    """The part of a figure that a panel fills with axes."""

    figure: Figure
    place: SubplotSpec

    def axes(self, **options: Any) -> Any:
        """Return axes that fill the cell, with their names and legend in it."""
        return self.figure.add_subplot(self.place.subgridspec(1, 1)[0], **options)

    def stack(self, n: int) -> list[Any]:
        """Return n axes above each other that share the axis of time."""
        grid = self.place.subgridspec(n, 1)
        stack = [self.figure.add_subplot(grid[0])]
        stack += [self.figure.add_subplot(grid[i], sharex=stack[0]) for i in range(1, n)]
        for axes in stack:
            if axes is not stack[-1]:
                axes.tick_params(labelbottom=False)
            axes.locator_params("y", nbins=4, steps=[1, 2, 5, 10])
        return stack


class Panel(NamedTuple):
    """A part of a figure.

    Attributes:
        name: in messages.
        needs: columns and parameters that a run must have, by the loop that is drawn.
        draw: fills a cell with the runs that have them.
        height: of the cell [in].
        of_one: if true, only the first run is shown.

    """

    name: str
    needs: Callable[[Loop], Needs]
    draw: Callable[[Cell, Sequence[Drawn]], None]
    height: float = 2.6
    of_one: bool = False


#: The rows of a figure.
Rows = Sequence[Sequence[Panel]]


# Parts that several panels share


def title(axes: Axes, text: str) -> None:
    """Put a title above the axes, and the legend of their lines below the title."""
    n = len(axes.get_legend_handles_labels()[0])
    if n < 2:
        axes.set_title(text)
        return
    # A wider legend would move the square of a path.
    abreast = 2 if axes.name == "3d" else 3
    axes.legend(
        title=text, alignment="left", ncols=n if n <= abreast else min(abreast, -(-n // 2)),
        loc="lower left", bbox_to_anchor=(0.0, 1.0),
    )  # fmt: skip


def over_time(panels: Sequence[Axes], runs: Sequence[Drawn], has_means: bool = False) -> None:
    """Give panels the time axis of all runs, with a label below the last panel, and mark events."""
    start = min(run.result.time[0] for run in runs)
    end = max(run.result.time[-1] for run in runs)
    for axes in panels:
        axes.set_xlim(start, end)
    _mark_events(panels, runs)
    window = mean_window(runs[0].result.time)
    means = f" (line: {window:.3g} s mean, band: raw)" if has_means else ""
    panels[-1].set_xlabel(f"time [s]{means}")


def run_line(i: int, colour: str) -> dict[str, Any]:
    """Return the style of the line of run i: the first is thick, the others are thin."""
    if not i:
        return {"color": colour, "linewidth": _THICK}
    dashes = _LONG_DASHES[(i - 1) % len(_LONG_DASHES)]
    return {"color": colour, "linewidth": _THIN, "linestyle": dashes}


def _draw_lines(
    axes: Axes,
    runs: Sequence[Drawn],
    lines: Callable[[Drawn], tuple[np.ndarray, np.ndarray]],
    labels: Sequence[str],
) -> None:
    """Draw each column of the values (rows, lines) of runs; from the second on, thin and black."""
    for i, run in enumerate(runs):
        time, values = lines(run)
        for j, (column, label) in enumerate(zip(values.T, labels, strict=True)):
            if i == 0:
                axes.plot(time, column, color=COLOURS[j], linestyle=STYLES[j], label=label)
            else:
                fits = len(runs) == 2 and len(run.label) <= _SHORT
                other = escape_math(run.label) if fits else "other runs"
                legend = other if (i, j) == (1, 0) else None
                axes.plot(time, column, color="black", linewidth=0.7, label=legend)


def frame_path(axes: Any, points: np.ndarray, z_up: bool) -> None:
    """Set limits, labels and box of 3D axes so that they hold the points of paths, (n, 3) [m]."""
    points = points[np.isfinite(points).all(axis=1)]
    lower, upper = np.min(points, axis=0), np.max(points, axis=0)
    extent = np.maximum(upper - lower, _FLATTEST * max(float((upper - lower).max()), 1e-3))
    middle = (lower + upper) / 2
    low, high = (middle - 0.54 * extent).tolist(), (middle + 0.54 * extent).tolist()
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    if not z_up:
        axes.invert_yaxis()
        axes.invert_zaxis()
    cell = _cell_size(axes)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        n = 4 if cell.min() > _LARGE_CELL else 3
        axis.get_major_locator().set_params(nbins=n, steps=None)
    axes.tick_params(labelsize="small", pad=0)
    # Any closer, a tick and a minus sign look like one dash.
    axes.zaxis.set_tick_params(pad=_Z_PAD)
    for artist in (*axes.lines, *axes.collections):
        # A flat box is wider than its square of axes.
        artist.set(clip_on=False, in_layout=False)
    box = np.maximum(extent, 0.5 * extent.max())
    axes.set_box_aspect(box)
    axes.set_box_aspect(box, zoom=_zoom(axes, cell))
    _label_box(axes, earth_axes(z_up))


def box_corners(axes: Any) -> np.ndarray:
    """Return the corners of a box on the page (2, 2, 2, 2), by the ends of x, y and z."""
    # Figures of a run need no 3D otherwise.
    from mpl_toolkits.mplot3d.proj3d import proj_transform  # noqa: PLC0415

    ends = np.meshgrid(axes.get_xlim(), axes.get_ylim(), axes.get_zlim(), indexing="ij")
    x, y, _ = proj_transform(*map(np.ravel, ends), axes.get_proj())
    return np.column_stack((x, y)).reshape(2, 2, 2, 2)


def _cell_size(axes: Any) -> np.ndarray:
    """Return the width and height of the cell of a path [in], as if texts had 10 pt."""
    place = axes.get_subplotspec().get_topmost_subplotspec()
    grid = place.get_gridspec()
    parts = ((grid.get_width_ratios(), place.colspan), (grid.get_height_ratios(), place.rowspan))
    share = [sum(ratios[i] for i in span) / sum(ratios) for ratios, span in parts]
    size: np.ndarray = share * axes.get_figure().get_size_inches() / text_scale()
    return size - (0.0, _LEGEND)


def _zoom(axes: Any, cell: np.ndarray) -> float:
    """Return the zoom with which a box of zoom 1, its numbers and names fill their cell."""
    to_axes = axes.transData + axes.transAxes.inverted()
    half = np.abs(to_axes.transform(box_corners(axes).reshape(-1, 2)) - 0.5).max(axis=0)
    room = np.maximum(cell - _AROUND_BOX, _LEAST_BOX)
    return float((room / (2.0 * half * cell.min())).min())


def _label_box(axes: Any, names: tuple[str, str, str]) -> None:
    """Write the names of the axes beside the edges that have numbers: x and y below, z above."""
    corners, offset = box_corners(axes), {"textcoords": "offset points", "annotation_clip": False}
    for k, (axis, side, ha) in enumerate(((axes.xaxis, -1, "right"), (axes.yaxis, 1, "left"))):
        middles = corners.mean(axis=k).reshape(4, 2)
        lowest = middles[middles[:, 1].argmin()]
        numbers = axis.get_major_formatter().format_ticks(axis.get_majorticklocs())
        away = text_scale() * (_BELOW + _LETTER * max(map(len, numbers)))
        axes.annotate(names[k], lowest, xytext=(side * away, -away), ha=ha, va="top", **offset)
    edges = corners.reshape(4, 2, 2)
    right = edges[edges[..., 0].mean(axis=1).argmax()]
    top = right[right[:, 1].argmax()]
    axes.annotate(names[2], top, xytext=(0, _ABOVE), ha="center", va="bottom", **offset)


def _axes_from_above(cell: Cell, z_up: bool) -> Any:
    """Return axes of equal scale with x upwards and y as in :func:`.earth_axes`."""
    x, y, _ = earth_axes(z_up)
    axes = cell.axes(xlabel=y, ylabel=x)
    axes.set_aspect("equal", adjustable="datalim")
    if z_up:
        axes.invert_xaxis()
    return axes


# Events: numbered lines in the panels, and a list below the figure


def _mark_events(panels: Sequence[Axes], runs: Sequence[Drawn]) -> None:
    """Draw a line where an event begins or ends, and its number at the foot of the first panel."""
    events = _events(runs)
    times = sorted(
        {(start, i) for i, spans in enumerate(events.values(), 1) for start, *_ in spans}
    )
    for time in {time for spans in events.values() for span in spans for time in span}:
        for axes in panels:
            axes.axvline(time, color="0.35", linewidth=0.8, linestyle=(0, (1, 1.5)), zorder=1)
    start, end = panels[0].get_xlim()
    last: list[float] = []  # time of the last number in each row
    for time, number in times:
        row = next(
            (k for k, other in enumerate(last) if time - other > _CLOSE * (end - start)),
            len(last),
        )
        last[row : row + 1] = [time]
        panels[0].annotate(
            str(number), (time, 0), xycoords=panels[0].get_xaxis_transform(),
            xytext=(0, row * _RISE), textcoords="offset points",
            ha="center", va="center", fontsize="x-small",
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": "0.35"},
        )  # fmt: skip


def list_events(figure: Figure, runs: Sequence[Drawn], grow: bool = True) -> None:
    """List events below a figure, with their numbers in its panels.

    Args:
        figure: with panels of the runs.
        runs: that have the events.
        grow: make the figure higher, so that its panels keep their height.

    """
    lines = [f"{i}: {_event_text(label, runs)}" for i, label in enumerate(_events(runs), 1)]
    if not lines:
        return
    text = textwrap.fill("; ".join(lines), int(_LETTERS * widths_of_text(figure)))
    if grow:
        rows = 2 + text.count("\n")
        figure.set_figheight(figure.get_figheight() + _LINE * rows * text_scale())
    figure.supxlabel(escape_math(text), x=0.01, ha="left", fontsize="small")


def _event_text(label: str, runs: Sequence[Drawn]) -> str:
    """Return the label of an event with its times, and its runs if they differ."""
    spans = {run.label: _spans(run).get(label, []) for run in runs}
    if len({*map(tuple, spans.values())}) == 1:
        return f"{label}, {_times_text(spans[runs[0].label])}"
    times = (f"{_times_text(of_run)} ({run})" for run, of_run in spans.items() if of_run)
    return f"{label}, {', '.join(times)}"


def _times_text(spans: Sequence[tuple[float, ...]]) -> str:
    words = [" to ".join(f"{time:.5g}" for time in span) + " s" for span in spans[:_MOST_TIMES]]
    return ", ".join([*words, *["..."] * (len(spans) > _MOST_TIMES)])


def _events(runs: Sequence[Drawn]) -> dict[str, set[tuple[float, ...]]]:
    """Return the spans of each event in any of the runs, sorted by the first start."""
    events: dict[str, set[tuple[float, ...]]] = {}
    for run in runs:
        for label, spans in _spans(run).items():
            events.setdefault(label, set()).update(spans)
    return dict(sorted(events.items(), key=lambda item: min(item[1])))


def _spans(run: Drawn) -> dict[str, list[tuple[float, ...]]]:
    """Return the start, and the end if there is one, of each occurrence of the events of a run."""
    occurrences = run.result.ending.events
    spans: dict[str, list[tuple[float, ...]]] = {}
    for i, start in enumerate(occurrences[:_MOST_MARKS], start=1):
        if start.label:
            later = (end for end in occurrences[i:] if not end.label and end.event == start.event)
            ends = (end.time for end in islice(later, 1))
            spans.setdefault(start.label, []).append((start.time, *ends))
    return spans


# Panels of one vehicle


def _path(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Paths of control points and their reference in three dimensions."""
    axes = cell.axes(projection="3d")
    paths = []
    for run, _ in list(runs_with(runs, Loop.for_reference))[:1]:
        paths.append(run.result.group(*run.loop.y_d))
        axes.plot(*paths[0].T, color=REFERENCE, linestyle="--", linewidth=1, label="reference")
        axes.scatter(*paths[0][0], color=REFERENCE, marker="s", s=20, label="reference start")
        if len(points := waypoints(run.result, run.loop)):
            paths.append(points)
            axes.scatter(
                *points.T, color="black", marker="x", s=25, depthshade=False, label="waypoints"
            )
    shown = list(runs_with(runs, Loop.for_control_point))
    for i, (run, colour) in enumerate(shown):
        y = true_control_point(run.result, run.loop)
        paths.append(y)
        axes.plot(*y.T, **run_line(i, colour), label=None if len(shown) > 1 else "control point")
        # Rings of growing size, so that common starts remain visible.
        axes.scatter(
            *y[0], marker="o", s=20 + 50 * i, edgecolors=colour,
            facecolors="none" if i else colour, label=None if i else "vehicle start",
        )  # fmt: skip
    frame_path(axes, np.vstack(paths), runs[0].z_up)
    title(axes, "path")


def _path_from_above(cell: Cell, runs: Sequence[Drawn]) -> None:
    axes = _axes_from_above(cell, runs[0].z_up)
    for run, colour in runs_with(runs, Loop.for_control_point):
        path = true_control_point(run.result, run.loop)
        axes.plot(path[:, 1], path[:, 0], color=colour)
        axes.plot(path[0, 1], path[0, 0], "o", color=colour)
    title(axes, "path from above")


def _all_errors(cell: Cell, runs: Sequence[Drawn]) -> None:
    """The three tracking errors in one panel."""
    axes = cell.axes(ylabel="error [m]")
    _draw_lines(
        axes,
        [run for run, _ in runs_with(runs, Loop.for_tracking)],
        lambda run: (run.result.time, tracking_error(run.result, run.loop)),
        [f"$e_{k}$" for k in AXES],
    )
    title(axes, "tracking errors")
    over_time([axes], runs)


def _errors(cell: Cell, runs: Sequence[Drawn], logarithmic: bool = False) -> None:
    """Tracking errors, a panel for each axis."""
    panels = cell.stack(3)
    for i, (run, colour) in enumerate(runs_with(runs, Loop.for_tracking)):
        errors = tracking_error(run.result, run.loop)
        for axes, error in zip(panels, (np.abs(errors) if logarithmic else errors).T, strict=True):
            axes.plot(run.result.time, error, **run_line(i, colour))
    for k, axes in zip(AXES, panels, strict=True):
        axes.set_ylabel(f"$|e_{k}|$ [m]" if logarithmic else f"$e_{k}$ [m]")
        if logarithmic:
            axes.set_yscale("log")
            axes.yaxis.get_major_locator().set_params(numticks=4)
            if axes.get_ylim()[1] > _SMALLEST_ERROR:
                axes.set_ylim(bottom=max(_SMALLEST_ERROR, axes.get_ylim()[0]))
    title(panels[0], "tracking errors" + ", logarithmic" * logarithmic)
    over_time(panels, runs)


def draw_commands(
    panels: Sequence[Axes], runs: Sequence[Drawn], name: str = "commanded control signals"
) -> None:
    """Draw the commands of runs and the limits of (3), a panel for each actuator."""
    shown = list(runs_with(runs, Loop.for_commands))
    limited = [run for run, _ in runs_with(runs, Loop.for_limits)]
    has_means = False
    for k, axes, unit in zip(range(3), panels, map(printed_unit, TAU.values()), strict=True):
        for i, (run, colour) in enumerate(shown):
            command = partial(_command, run.loop.commanded[k])
            has_means |= draw_signal(axes, run.result, command, **run_line(i, colour))
        axes.set_ylabel(rf"$\tau_{ACTUATORS[k]}$ [{unit}]")
        if limited:
            _draw_limits(axes, k, shown, limited[0], unit)
    title(panels[0], name)
    over_time(panels, runs, has_means)


def _command(column: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values of a command; the last value is held until the end of the run."""
    command = table.step_values(column)[:, 0]
    return np.append(table.step_start, table.time[-1]), np.append(command, command[-1])


def _draw_limits(
    axes: Axes, k: int, runs: Sequence[tuple[Drawn, str]], limited: Drawn, unit: str
) -> None:
    """Draw the limits of an actuator; print the largest command if it is off the axis."""
    lower, upper = (float(limit[k]) for limit in limits(limited.result, limited.loop))
    words = (
        f"limits ±{upper:g} {unit}" if lower == -upper else f"limits {lower:g}, {upper:g} {unit}"
    )
    peaks = ((_peak(run.result.step_values(run.loop.commanded[k])), colour) for run, colour in runs)
    peak, colour = max(peaks, key=lambda pair: abs(pair[0]))
    if abs(peak) < _NEAR * min(upper, -lower):
        bottom, top = axes.get_ylim()
        axes.set_ylim(bottom, top + 0.2 * (top - bottom))
        _write(axes, [(f"{words} (off scale)", "black")], 0.98, axes.transAxes, "top")
        return
    for limit in (lower, upper):
        axes.axhline(limit, color="black", linewidth=0.8)
    bottom, _ = axes.get_ylim()
    axes.set_ylim(max(min(bottom, 1.2 * lower), _BEYOND * lower), _BEYOND * upper)
    texts = [(words, "black")]
    if abs(peak) > _BEYOND * max(upper, -lower):
        number = f"{peak:,.0f}" if abs(peak) < _MANY else f"{peak:.2g}"
        number = number.replace("-", "\N{MINUS SIGN}")
        texts.append((f"peak {number} {unit}", colour))
    _write(axes, texts, upper, axes.get_yaxis_transform(), "bottom")


def _peak(values: np.ndarray) -> float:
    """Return the finite value that is farthest from 0, with its sign; 0 if there is none."""
    values = values[np.isfinite(values)]
    return float(values[np.abs(values).argmax()]) if len(values) else 0.0


def _write(
    axes: Axes, texts: Sequence[tuple[str, str]], y: float, transform: Transform, va: str
) -> None:
    """Write texts in their colours at the right of a panel, on a background that covers lines."""
    place: tuple[Any, ...] = (1.0, y), transform, (0, 2 if va == "bottom" else 0)
    for text, colour in reversed(texts):
        at, coordinates, offset = place
        written = axes.annotate(
            text, at, xycoords=coordinates, xytext=offset, textcoords="offset points",
            ha="right", va=va, fontsize="small", color=colour,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
        )  # fmt: skip
        place = (0.0, 0.0 if va == "bottom" else 1.0), written, (-5, 0)


def _estimates(cell: Cell, runs: Sequence[Drawn]) -> None:
    axes = cell.axes(ylabel="estimate")
    labels = [rf"$\hat{{\theta}}_{i}$ [{unit}]" for i, unit in THETA.items()]
    _draw_lines(
        axes,
        [run for run, _ in runs_with(runs, Loop.for_parameter_estimates)],
        lambda run: (run.result.step_start, run.result.step_values(*run.loop.theta_hat)),
        labels,
    )
    title(axes, "estimated parameters")
    over_time([axes], runs)


def _velocity(cell: Cell, runs: Sequence[Drawn], *, errors: bool = False) -> None:
    """Estimated and true velocity of the control point, or the errors of the estimate."""
    run, _ = next(runs_with(runs, Loop.for_velocity_estimates))
    table, panels, has_means = run.result, cell.stack(3), False
    for k, axes, estimate, truth in zip(AXES, panels, run.loop.dy_hat, run.loop.dy, strict=True):
        signal = partial(_estimated_velocity, estimate, truth if errors else None)
        has_means |= draw_signal(axes, table, signal, color=COLOURS[1], label="estimated")
        axes.set_ylabel(rf"$\Delta \dot{{y}}_{k}$ [m/s]" if errors else rf"$\dot{{y}}_{k}$ [m/s]")
        if not errors:
            axes.plot(
                table.step_start, table.start_values(truth)[:, 0],
                color=COLOURS[0], linestyle="--", label="true (not measured)",
            )  # fmt: skip
    title(panels[0], "estimate - true" if errors else "velocity of the control point")
    over_time(panels, runs, has_means)


def _estimated_velocity(
    estimate: str, truth: str | None, table: Table
) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values of an estimate, minus the truth if it is given."""
    values = table.step_values(estimate)[:, 0]
    return table.step_start, values - table.start_values(truth)[:, 0] if truth else values


def _motion(name: str, directions: slice, is_rate: bool = False) -> Panel:
    """Return a panel of velocities, or of D nu/dt by the plant's Euler scheme: nu' - nu over h."""
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
        labels = [symbol.format(column[-1]) for column in columns]
        _draw_lines(axes, [run], lambda _: (time, values), labels)
        title(axes, name)
        over_time([axes], runs)

    return Panel(name, needs, draw, of_one=True)


# Panels of several vehicles


def _vehicles(run: Drawn, needs: Callable[[Loop], Needs]) -> Iterator[tuple[Loop, str]]:
    """Yield the vehicles that have what is needed, each with its colour."""
    for loop, colour in zip(run.loops, vehicle_colours(len(run.loops)), strict=True):
        if not run.result.missing(*needs(loop)):
            yield loop, colour


def _vehicle_label(run: Drawn, loop: Loop) -> str | None:
    return loop.name if len(run.loops) <= _MOST_NAMED else None


def _marks(run: Drawn, loop: Loop) -> dict[str, Any]:
    """Return the marks on the line of a vehicle, which do not cover another's; none of many."""
    n, i = len(run.loops), run.loops.index(loop)
    if n > _MOST_NAMED:
        return {}
    apart = max(1, len(run.result) // _MARKS_ON_A_LINE)
    return {
        "marker": MARKS[i],
        "markersize": _MARK,
        "markevery": (apart * (i + 1) // (n + 1), apart),
    }


def _fleet_paths(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Paths of the control points of the first run, and their references."""
    run, axes = runs[0], cell.axes(projection="3d")
    paths = []
    for loop, _ in _vehicles(run, Loop.for_reference):
        paths.append(run.result.group(*loop.y_d))
        axes.plot(*paths[-1].T, color=REFERENCE, linestyle=":", linewidth=0.8)
    for loop, colour in _vehicles(run, Loop.for_control_point):
        paths.append(true_control_point(run.result, loop))
        axes.plot(
            *paths[-1].T, color=colour, linewidth=1.3, label=_vehicle_label(run, loop),
            **_marks(run, loop),
        )  # fmt: skip
        mark = _marks(run, loop).get("marker", MARKS[0])
        axes.scatter(*paths[-1][0], color=colour, marker=mark, s=40)
    frame_path(axes, np.vstack(paths), run.z_up)
    title(axes, f"paths{_whose(runs)}, references dotted")


def _fleet_from_above(cell: Cell, runs: Sequence[Drawn]) -> None:
    """The same paths from above, with lines from the first vehicle to the others at some times."""
    run, axes = runs[0], _axes_from_above(cell, runs[0].z_up)
    shown = list(_vehicles(run, Loop.for_control_point))
    paths = [true_control_point(run.result, loop) for loop, _ in shown]
    for path, (_, colour) in zip(paths, shown, strict=True):
        axes.plot(path[:, 1], path[:, 0], color=colour, linewidth=0.8)
    time = run.result.time
    instants = np.linspace(time[0], time[-1], _INSTANTS)
    rows = np.searchsorted(time, instants).clip(0, len(time) - 1)
    points = np.array([path[rows, 1::-1] for path in paths])
    for place in points[1:]:
        spokes = np.stack((points[0], place)).transpose(2, 0, 1)
        axes.plot(*spokes, color="black", linewidth=0.8, zorder=3)
    for place, (loop, colour) in zip(points, shown, strict=True):
        mark = _marks(run, loop).get("marker", MARKS[0])
        axes.scatter(*place.T, color=colour, marker=mark, s=14, zorder=4)
    between = (time[-1] - time[0]) / (_INSTANTS - 1)
    title(axes, f"from above{_whose(runs)}, joined every {between:.3g} s")


def _fleet_errors(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Norm of the tracking error of each vehicle."""
    axes = cell.axes(ylabel="|e| [m]")
    for run, style in zip(runs, _RUN_STYLES, strict=False):
        for loop, colour in _vehicles(run, Loop.for_tracking):
            error = size(tracking_error(run.result, loop))
            label = _vehicle_label(run, loop) if run is runs[0] else None
            axes.plot(
                run.result.time, error, color=colour, label=label, **style, **_marks(run, loop)
            )
    axes.set_ylim(bottom=0.0)
    compared = f", {escape_math(runs[1].label)} dashed" if len(runs) > 1 else ""
    title(axes, f"size of the tracking errors{compared}")
    over_time([axes], runs)


def _needs_distances(loop: Loop) -> Needs:
    return for_distances([loop])


def _distances(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Distance between each two of a few vehicles, or the smallest distance of all."""
    axes = cell.axes(ylabel="distance [m]")
    for run, style in zip(runs, _RUN_STYLES, strict=False):
        loops = [loop for loop, _ in _vehicles(run, _needs_distances)]
        if len(loops) <= _MOST_NAMED and run is runs[0]:
            apart = distances(run.result, loops)
            for i, (names, values) in enumerate(apart.items()):
                look = {"color": COLOURS[i % len(COLOURS)], "linestyle": STYLES[i % len(STYLES)]}
                axes.plot(run.result.time, values, label=" to ".join(names), **look)
        else:
            smallest = smallest_distances(run.result, loops)
            label = f"smallest, {escape_math(run.label)}" if len(runs) > 1 else "smallest"
            axes.plot(run.result.time, smallest, label=label, **style, color="black")
    axes.set_ylim(bottom=0.0)
    title(axes, "distances between vehicles")
    over_time([axes], runs)


def _smallest_distance(cell: Cell, runs: Sequence[Drawn]) -> None:
    """Smallest distance between any two vehicles."""
    axes, table = cell.axes(ylabel="distance [m]"), runs[0].result
    axes.plot(table.time, smallest_distances(table, runs[0].loops), color=REFERENCE)
    axes.set_ylim(bottom=0.0)
    title(axes, SMALLEST_DISTANCE_LABEL)
    over_time([axes], runs)


def _whose(runs: Sequence[Drawn]) -> str:
    """Return the name of the only run that is shown, if there are others."""
    return f" ({escape_math(runs[0].label)})" if len(runs) > 1 else ""


PATH = Panel("path", Loop.for_control_point, _path, 4.0)
FROM_ABOVE = Panel("path from above", Loop.for_control_point, _path_from_above)
ALL_ERRORS = Panel("tracking errors", Loop.for_tracking, _all_errors, 2.8)
ERRORS = Panel("tracking errors", Loop.for_tracking, _errors, 4.0)
LOGARITHMIC_ERRORS = Panel(
    "logarithmic tracking errors", Loop.for_tracking, partial(_errors, logarithmic=True), 4.0
)
COMMANDS = Panel(
    "commands", Loop.for_commands, lambda cell, runs: draw_commands(cell.stack(3), runs), 4.0
)
ESTIMATES = Panel("estimated parameters", Loop.for_parameter_estimates, _estimates, 3.2)
VELOCITY = Panel("estimated velocity", Loop.for_velocity_estimates, _velocity, 4.6, of_one=True)
VELOCITY_ERRORS = Panel(
    "error of the estimated velocity", Loop.for_velocity_estimates,
    partial(_velocity, errors=True), 4.6, of_one=True,
)  # fmt: skip
FLEET_PATHS = Panel("paths", Loop.for_control_point, _fleet_paths, 3.6, of_one=True)
FLEET_FROM_ABOVE = Panel(
    "paths from above", Loop.for_control_point, _fleet_from_above, 3.6, of_one=True
)
FLEET_ERRORS = Panel("sizes of errors", Loop.for_tracking, _fleet_errors, 3.0, of_one=True)
DISTANCES = Panel("distances", _needs_distances, _distances, 3.0, of_one=True)
SMALLEST_DISTANCE = Panel("smallest distance", _needs_distances, _smallest_distance, of_one=True)

_SURGE, _LINEAR, _ANGULAR = slice(1), slice(3), slice(3, None)

#: Name of the figure of several vehicles together, and the number of vehicles up to which each
#: also has a figure of its own.
FLEET, MOST_DRAWN = "fleet", 10

#: Figures by name: for each, its files' suffixes and the rows of panels in each file.
FIGURES: Mapping[str, Mapping[str, Rows]] = {
    # Figs. 4 and 7: one run, and thin and black another one, for example without noise.
    "tracking": {
        "": ((PATH, ALL_ERRORS), (COMMANDS, ESTIMATES)),
        "-velocity": ((VELOCITY, VELOCITY_ERRORS),),
    },
    # Fig. 5.
    "comparison": {"": ((PATH, COMMANDS), (ERRORS, LOGARITHMIC_ERRORS))},
    # Fig. 6: the paper shows no control signals.
    "comparison-errors": {"": ((ERRORS, LOGARITHMIC_ERRORS),)},
    # Fig. 7 in one figure: any number of runs.
    "overlay": {"": ((ERRORS, COMMANDS),)},
    FLEET: {"": ((FLEET_PATHS, FLEET_FROM_ABOVE), (FLEET_ERRORS, DISTANCES))},
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
    """Yield the figures of a run: of all vehicles together, and of each.

    Args:
        key: of :data:`FIGURES`, for a single vehicle.
        loops: of the vehicles.

    Yields:
        A key of :data:`FIGURES`, the vehicle's part of the file names, and the loops to draw.

    """
    if len(loops) > 1 or key == FLEET:
        yield FLEET, "", loops
    if len(loops) <= MOST_DRAWN and key != FLEET:
        yield from ((key, vehicle, [loop]) for loop, vehicle in suffixes(loops).items())


def main_figure(key: str, loops: Sequence[Loop], vehicle: str = "") -> str:
    """Return the figure that stands for a run: of several vehicles together, unless one is named.

    Args:
        key: of :data:`FIGURES`, for a single vehicle.
        loops: of the vehicles.
        vehicle: name of one; empty: all.

    """
    return FLEET if len(loops) > 1 and not vehicle else key


def check_figure(key: str) -> None:
    """Raise an InputError if there is no figure with a name."""
    if key not in FIGURES:
        hint = did_you_mean(key, FIGURES) or f"; there are {', '.join(FIGURES)}"
        raise InputError(f"no figure {key!r}{hint}")


def figure_files(key: str, stem: str, loops: Sequence[Loop] = (STANDARD,)) -> list[str]:
    """Return the names of all files that :func:`.draw` may write for some vehicles.

    Args:
        key: of :data:`FIGURES`.
        stem: of the file names.
        loops: of the vehicles; without any, there is one figure of all signals.

    """
    if not loops:
        return [f"{stem}.{ending}" for ending in FIGURE_FORMATS]
    return [
        f"{stem}{vehicle}{suffix}.{ending}"
        for figure, vehicle, _ in figures_of(key, loops)
        for suffix in FIGURES[figure]
        for ending in FIGURE_FORMATS
    ]
