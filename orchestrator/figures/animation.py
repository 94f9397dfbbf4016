"""A run in motion: the vehicle as a camera sees it that follows, beside it errors and commands."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from auv_fmu.attitude import rotation_from_euler
from orchestrator.figures.body import PAINT, Z_UP, body
from orchestrator.figures.drawing import styled
from orchestrator.figures.event_marks import list_events
from orchestrator.figures.panels import Cell, draw_all_errors, draw_commands, over_time
from orchestrator.figures.style import COLOURS, REFERENCE, Drawn, heading
from orchestrator.figures.visible import moving_mean
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.signals import Loop, real_parameter, true_control_point

FRAMES_PER_SECOND = 20

#: Length of a film, whatever the length of the run [s].
_DURATION = 10.0

#: Size of the picture [in], and its resolution [1/in].
_SIZE, _DPI = (8.4, 5.0), 90

#: What the camera sees is as wide as this many ell, and wider where the reference is far away: by
#: this factor of the distance.
_NEAREST, _SEPARATION = 14.0, 1.7

#: Time over which the camera adapts, as a share of the run.
_INERTIA = 0.05

#: Length of the vehicle as a share of what the camera sees: to scale it would be a dot.
_VEHICLE = 0.3

#: Distance of the camera in widths of what it sees, and its direction, north-east-down.
_DISTANCE = 2.2
_DIRECTION = np.array([-0.75, -0.5, -0.45])

#: What is nearer to the camera than this many widths is behind it.
_BEHIND = 0.2

#: Lines of the ground on either side of the camera's middle, and its depth below it in widths.
_GROUND_LINES, _GROUND_DEPTH = 7, 0.4


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
    """Write a film of a run.

    Args:
        text: heading.
        run: with the ports of the vehicle, and of the planner if there is a reference.
        path: of a .gif, or of an .mp4 where ffmpeg is installed.
        fps: frames per second.

    Raises:
        InputError: the file cannot be written.

    """
    check_film(path, fps)
    frames = _frames(text, run, int(_DURATION * fps))
    (_write_mp4 if path.suffix == ".mp4" else _write_gif)(frames, path, fps)


def _write_gif(frames: Iterator[Image.Image], path: Path, fps: int) -> None:
    palette = next(frames).quantize(128, method=Image.Quantize.MAXCOVERAGE)
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
        scene = _Scene(figure.add_subplot(grid[0]), run)
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
            for artist in scene.artists(row):
                scene.axes.draw_artist(artist)
            for axes, marker in zip(series, markers, strict=True):
                marker.set_xdata([table.time[row]] * 2)
                axes.draw_artist(marker)
            yield Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())


def _draw_series(cell: Cell, run: Drawn) -> list[Any]:
    """Errors and commands over time, as far as they are there."""
    has_errors, has_commands = not run.lacks(Loop.for_tracking), not run.lacks(Loop.for_commands)
    panels = cell.stack(has_errors + 3 * has_commands)
    if has_errors:
        draw_all_errors(panels[0], [run])
    if has_commands:
        draw_commands(panels[has_errors:], [run])
    over_time(panels, [run])
    return panels


class _Scene:
    """What a camera sees that follows the vehicle."""

    def __init__(self, axes: Any, run: Drawn) -> None:
        self.axes = axes
        table, loop = run.result, run.loop
        # All is seen in axes whose z is down.
        self._turn = Z_UP if run.z_up else np.ones(3)
        axes.set(xlim=(-0.5, 0.5), ylim=(-0.56, 0.56), aspect="equal", adjustable="box")
        axes.set_axis_off()
        self._time = table.time
        self._y = true_control_point(table, loop) * self._turn
        self._euler = table.group(*loop.attitude)
        self._y_d = None if table.missing(loop.y_d) else table.group(*loop.y_d) * self._turn
        self._body = body()
        nearest = _NEAREST * real_parameter(table, loop.ell)
        middle, width = self._y, np.full(len(self._y), nearest)
        if self._y_d is not None:
            middle = 0.5 * (self._y + self._y_d)
            distance = np.linalg.norm(self._y - self._y_d, axis=1)
            width = np.maximum(nearest, _SEPARATION * distance)
        window = _INERTIA * float(np.ptp(table.time))
        self._middle, self._width = (
            np.column_stack([moving_mean(table.time, column, window) for column in values.T])
            for values in (middle, width[:, np.newaxis])
        )
        self._ground = LineCollection([], colors="#d5dde3", linewidths=0.8)
        self._reference = LineCollection([], colors=REFERENCE, linewidths=1.0, linestyles="--")
        self._trail = LineCollection([], colors=COLOURS[0], linewidths=1.8)
        self._drop = LineCollection([], colors="#9aa7b0", linewidths=0.8, linestyles=":")
        self._hull = PolyCollection([], edgecolors="face", linewidths=0.3)
        (self._target,) = axes.plot([], [], "s", color=REFERENCE, markersize=6)
        self._caption = axes.text(0.0, 1.0, "", transform=axes.transAxes, va="top")
        self._marks = [axes.text(0, 0, k, ha="center", va="center", color="#5b6b76") for k in "NE"]
        for collection in (self._ground, self._reference, self._trail, self._drop, self._hull):
            axes.add_collection(collection, autolim=False)
        for artist in self._all():
            artist.set_animated(True)

    def _all(self) -> list[Any]:
        return [
            self._ground, self._drop, self._reference, self._trail, self._target, self._hull,
            self._caption, *self._marks,
        ]  # fmt: skip

    def artists(self, row: int) -> list[Any]:
        """What to draw at a row, from back to front."""
        middle, width = self._middle[row], float(self._width[row, 0])
        camera = _Camera.at(middle, width)
        spacing = self._show_ground(camera, middle, width)
        self._trail.set_segments(camera.line(self._y[: row + 1]))
        if self._y_d is not None:
            self._reference.set_segments(camera.line(self._y_d))
            self._target.set_data(*camera.project(self._y_d[row : row + 1])[0].T)
        below = self._y[row].copy()
        below[2] = middle[2] + _GROUND_DEPTH * width
        self._drop.set_segments(camera.line(np.array([self._y[row], below])))
        self._show_body(camera, row, _VEHICLE * width)
        time, z = self._time[row], self._y[row, 2] * self._turn[2]
        up = "up" if self._turn[2] < 0.0 else "down"
        self._caption.set_text(f"t = {time:.1f} s\nz = {z:.1f} m (z {up})\ngrid {spacing:g} m")
        return self._all()

    def _show_ground(self, camera: _Camera, middle: np.ndarray, width: float) -> float:
        """Draw a grid that stands still while the camera moves; its spacing [m]."""
        spacing = 10.0 ** np.floor(np.log10(width / 3.0))
        depth = middle[2] + _GROUND_DEPTH * width
        n = _GROUND_LINES
        spacing *= next(f for f in (1.0, 2.0, 5.0, 10.0) if f * spacing * n >= width)
        offsets = spacing * np.arange(-n, n + 1)
        x, y = (spacing * np.round(middle[k] / spacing) + offsets for k in (0, 1))
        lines = [np.array([(a, b, depth) for b in (y[0], y[-1])]) for a in x]
        lines += [np.array([(a, b, depth) for a in (x[0], x[-1])]) for b in y]
        for mark, (a, b) in zip(self._marks, ((0.55, 0.0), (0.0, 0.55)), strict=True):
            place = np.array([[middle[0] + a * width, middle[1] + b * width, depth]])
            mark.set_position(camera.project(place)[0][0])
        self._ground.set_segments([piece for line in lines for piece in camera.line(line)])
        return float(spacing)

    def _show_body(self, camera: _Camera, row: int, length: float) -> None:
        R = np.array(rotation_from_euler(*self._euler[row].tolist())).T
        # Of a body whose axes are turned as the earth's are.
        R *= np.outer(self._turn, self._turn)
        points = self._y[row] + length * self._body.points @ R.T
        corners = points[self._body.triangles]
        seen, depth = camera.project(corners.reshape(-1, 3))
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        # Light from above; a triangle has two sides.
        light = 0.45 + 0.55 * np.abs(normals @ np.array([0.3, -0.35, -0.89]))
        colours = np.array([to_rgb(colour) for colour in PAINT])[self._body.part]
        order = np.argsort(-depth.reshape(-1, 3).mean(axis=1))
        self._hull.set_verts(list(seen.reshape(-1, 3, 2)[order]))
        self._hull.set_facecolor((colours * light[:, np.newaxis])[order].clip(0, 1))


class _Camera(NamedTuple):
    """A perspective view.

    Attributes:
        place: of the camera, earth frame [m].
        axes: unit vectors to the right, up and ahead, (3, 3).
        width: what it sees in the middle [m]; it is 1 wide in the picture.

    """

    place: np.ndarray
    axes: np.ndarray
    width: float

    @classmethod
    def at(cls, middle: np.ndarray, width: float) -> _Camera:
        """A camera that looks at a point, and sees this width there [m]."""
        ahead = -_DIRECTION / np.linalg.norm(_DIRECTION)
        right = np.cross(np.array([0.0, 0.0, 1.0]), ahead)
        right /= np.linalg.norm(right)
        up = np.cross(right, ahead)
        return cls(middle - _DISTANCE * width * ahead, np.array([right, up, ahead]), width)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where points are in the picture, (n, 2), and how far from the camera [m]."""
        right, up, ahead = self.axes @ (points - self.place).T
        distance = np.maximum(ahead, 1e-9)
        return _DISTANCE * np.column_stack((right, up)) / distance[:, np.newaxis], ahead

    def line(self, points: np.ndarray) -> list[np.ndarray]:
        """A line in the picture, in pieces where it passes behind the camera."""
        seen, ahead = self.project(points)
        is_hidden = ahead < _BEHIND * self.width
        breaks = np.flatnonzero(np.diff(is_hidden)) + 1
        pieces = zip(np.split(seen, breaks), np.split(is_hidden, breaks), strict=True)
        return [piece for piece, hidden in pieces if not hidden[0]]
