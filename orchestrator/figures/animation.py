"""A run in motion: its vehicles as a camera sees them, beside them signals over time."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from orchestrator.figures.drawing import styled
from orchestrator.figures.event_marks import list_events
from orchestrator.figures.film_scene import Scene
from orchestrator.figures.panels import Cell, draw_all_errors, draw_commands, over_time, title
from orchestrator.figures.style import REFERENCE, Drawn, escape_math, heading, vehicle_colours
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.distances import SMALLEST_DISTANCE_LABEL, size, smallest_distances
from orchestrator.vehicle.signals import Loop, tracking_error

FRAMES_PER_SECOND = 20

#: Length of a film, whatever the length of the run [s].
_DURATION = 10.0

#: Size of the picture [in], and its resolution [1/in].
_SIZE, _DPI = (8.4, 5.0), 90

#: Points that lines of several vehicles are drawn through.
_POINTS = 1000

#: An axis that begins at 0 ends at this multiple of the largest value.
_ROOM = 1.05

#: Colours of a film of one vehicle, and of several.
_COLOURS = 128, 256

#: Of more vehicles none is named.
_MOST_NAMED = 24

#: Letters in a row of the legend, of which the line of a vehicle takes some.
_LETTERS, _LINE = 54, 4


def check_film(path: Path, fps: int) -> None:
    """Check before a run that its film can be written.

    Raises:
        InputError: the format is unknown or not available, or there are no frames.

    """
    if path.suffix not in (".gif", ".mp4"):
        raise InputError(f"{path}: must end with .gif or .mp4")
    if path.suffix == ".mp4" and which("ffmpeg") is None:
        raise InputError(f"{path}: an .mp4 needs ffmpeg, which is not installed; write a .gif")
    if not 1 <= fps <= 50:
        raise InputError(f"--fps {fps}: must be from 1 to 50")


def animate(text: str, run: Drawn, path: Path, fps: int = FRAMES_PER_SECOND) -> None:
    """Write a film of a run: of its vehicle, or of all of them together.

    Args:
        text: heading.
        run: with the ports of its vehicles, and of their planners if there are references.
        path: of a .gif, or of an .mp4 where ffmpeg is installed.
        fps: frames per second.

    Raises:
        InputError: the file cannot be written.

    """
    check_film(path, fps)
    frames = _frames(text, run, int(_DURATION * fps))
    if path.suffix == ".mp4":
        _write_mp4(frames, path, fps)
    else:
        _write_gif(frames, path, fps, _COLOURS[len(run.loops) > 1])


def _write_gif(frames: Iterator[Image.Image], path: Path, fps: int, colours: int) -> None:
    palette = next(frames).quantize(colours, method=Image.Quantize.MAXCOVERAGE)
    # One palette for all: colours do not flicker, and it is found once.
    rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    palette.save(
        path, save_all=True, append_images=rest, duration=1000 // fps, loop=0, optimize=False
    )


def _write_mp4(frames: Iterator[Image.Image], path: Path, fps: int) -> None:
    first = next(frames)
    command = [
        "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{first.width}x{first.height}", "-r", str(fps), "-i", "-",
        "-pix_fmt", "yuv420p", str(path),
    ]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        process.stdin.write(first.tobytes())
        for frame in frames:
            process.stdin.write(frame.tobytes())
        process.stdin.close()
    if process.returncode != 0:
        raise InputError(f"{path}: ffmpeg could not write it")


def _frames(text: str, run: Drawn, n: int) -> Iterator[Image.Image]:
    """Pictures of a run: what does not move is drawn once."""
    table = run.result
    instants = np.linspace(table.time[0], table.time[-1], n)
    rows = np.searchsorted(table.time, instants).clip(0, len(table) - 1)
    with styled():
        figure = Figure(figsize=_SIZE, dpi=_DPI)
        canvas: Any = FigureCanvasAgg(figure)
        figure.suptitle(heading(text))
        grid = figure.add_gridspec(1, 2, width_ratios=(1.5, 1))
        # Of one vehicle all rows are drawn, of several as many as can be seen.
        kept = np.arange(len(table)) if len(run.loops) == 1 else _seen(table.time, rows)
        scene = Scene(figure.add_subplot(grid[0]), run, kept)
        if 1 < len(run.loops) <= _MOST_NAMED:
            _name_vehicles(scene.axes, run)
        series = _draw_series(Cell(figure, grid[1]), run)
        list_events(figure, [run], grow=False)
        markers = [
            axes.axvline(0.0, color="black", linewidth=1.0, animated=True) for axes in series
        ]
        canvas.draw()
        figure.set_layout_engine("none")
        background = canvas.copy_from_bbox(figure.bbox)
        for row in rows.tolist():
            canvas.restore_region(background)
            for artist in scene.artists(int(np.searchsorted(kept, row))):
                scene.axes.draw_artist(artist)
            for axes, marker in zip(series, markers, strict=True):
                marker.set_xdata([table.time[row]] * 2)
                axes.draw_artist(marker)
            yield Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())


def _seen(time: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """These rows of a run, and more between them."""
    instants = np.linspace(time[0], time[-1], _POINTS)
    others = np.searchsorted(time, instants).clip(0, len(time) - 1)
    seen: np.ndarray = np.unique(np.concatenate((rows, others)))
    return seen


def _name_vehicles(axes: Any, run: Drawn) -> None:
    """Say below the scene which colour is which vehicle's."""
    lines = [
        Line2D([], [], color=colour, label=escape_math(loop.name))
        for loop, colour in zip(run.loops, vehicle_colours(len(run.loops)), strict=True)
    ]
    longest = max(len(loop.name) for loop in run.loops)
    columns = max(1, min(_LETTERS // (longest + _LINE), len(lines)))
    axes.legend(handles=lines, loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=columns)


def _draw_series(cell: Cell, run: Drawn) -> list[Any]:
    """Signals over time, as far as they are there."""
    return (_series_of_one if len(run.loops) == 1 else _series_of_several)(cell, run)


def _series_of_one(cell: Cell, run: Drawn) -> list[Any]:
    """Errors and commands."""
    has_errors, has_commands = not run.lacks(Loop.for_tracking), not run.lacks(Loop.for_commands)
    panels = cell.stack(has_errors + 3 * has_commands)
    if has_errors:
        draw_all_errors(panels[0], [run])
    if has_commands:
        draw_commands(panels[has_errors:], [run])
    over_time(panels, [run])
    return panels


def _series_of_several(cell: Cell, run: Drawn) -> list[Any]:
    """Sizes of the errors of all vehicles, and the smallest distance between two of them."""
    table = run.result
    tracked = [
        (loop, colour)
        for loop, colour in zip(run.loops, vehicle_colours(len(run.loops)), strict=True)
        if not table.missing(*loop.for_tracking())
    ]
    *of_errors, of_distance = panels = cell.stack(bool(tracked) + 1)
    for axes in of_errors:
        for loop, colour in tracked:
            axes.plot(table.time, size(tracking_error(table, loop)), color=colour)
        axes.set_ylabel("|e| [m]")
        title(axes, "sizes of the tracking errors")
    of_distance.plot(table.time, smallest_distances(table, run.loops), color=REFERENCE)
    of_distance.set_ylabel("distance [m]")
    title(of_distance, SMALLEST_DISTANCE_LABEL)
    for axes in panels:
        axes.set_ylim(0.0, _ROOM * axes.get_ylim()[1])
    over_time(panels, [run])
    return panels
