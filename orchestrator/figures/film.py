"""A film of a run: its vehicles in space, and next to them signals over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any, NamedTuple

import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from PIL import Image

from auv_fmu.paper.attitude import rotation_from_euler
from orchestrator.figures.drawing import styled
from orchestrator.figures.run_figures import (
    ALL_ERRORS,
    COMMANDS,
    FLEET_ERRORS,
    SMALLEST_DISTANCE,
    Cell,
    frame_path,
    list_events,
)
from orchestrator.figures.style import (
    COLOURS,
    FIN,
    REFERENCE,
    RINGS,
    Drawn,
    heading,
    reference_colours,
    vehicle_colours,
)
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.signals import real_parameter, true_control_point

#: Number of sides of the hull.
_SIDES = 12

#: Colours of the hull of a single vehicle, of the upper fin (it shows the roll) and of other fins.
_HULL, _UPPER, _OTHER = COLOURS[5], COLOURS[0], REFERENCE

#: Edges of the faces of the hull.
_EDGES: Any = {"edgecolors": "#333333", "linewidths": 0.2}

#: Length of the drawn vehicle: a share of the largest extent of the paths, but at least this
#: multiple of ell.
_SHARE, _LENGTH = 0.2, 2.0

#: Largest number of points of a drawn path, and of vehicles that are named.
_POINTS, _MOST_NAMED = 2000, 12

#: Panels next to the scene with their shares of the height, for one vehicle and for several.
_PANELS = {False: {ALL_ERRORS: 2, COMMANDS: 3}, True: {FLEET_ERRORS: 1, SMALLEST_DISTANCE: 1}}

#: Length of a film without a given speed [s].
_DURATION = 10.0

#: Width and height of the figure of a film [in] of 16 : 9; others have as many pixels per inch as
#: keep their texts as large.
_FIGURE = 9.6, 5.4

#: Options of ffmpeg: fast, and without visible loss.
_ENCODING = ("-preset", "veryfast", "-crf", "20")

#: Smallest and largest width and height [px].
_SIZES = 200, 4000


class Film(NamedTuple):
    """Options of a film.

    Attributes:
        fps: frames per second.
        size: width and height [px].
        speed: seconds of the run per second of the film; None: the film lasts 10 s.

    """

    fps: int = 20
    size: tuple[int, int] = (960, 540)
    speed: float | None = None

    @property
    def dpi(self) -> float:
        """Pixels per inch of its figure."""
        return min(pixels / length for pixels, length in zip(self.size, _FIGURE, strict=True))

    def check(self, path: Path) -> None:
        """Raise an InputError if a film with these options cannot be written to a path."""
        if path.suffix not in FILMS:
            raise InputError(f"{path}: must end with .gif or .mp4")
        if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
            raise InputError(f"{path}: an .mp4 needs ffmpeg, which is not installed; write a .gif")
        if not 1 <= self.fps <= 50:
            raise InputError(f"--fps {self.fps}: must be from 1 to 50")
        least, most = _SIZES
        if not all(least <= pixels <= most for pixels in self.size):
            raise InputError(f"--size: width and height must be from {least} to {most}")
        if self.speed is not None and not 0.0 < self.speed < inf:
            raise InputError(f"--speed {self.speed:g}: must be positive, and finite")


#: Defaults by the ending of the file: a GIF has every pixel of every frame in it.
FILMS = {".mp4": Film(25, (1920, 1080), 1.0), ".gif": Film()}


def default_ending() -> str:
    """Return .mp4 if ffmpeg is installed, else .gif."""
    return ".mp4" if FFMpegWriter.isAvailable() else ".gif"


class _Drawn(Figure):
    """A figure that is not drawn again for a writer of films."""

    def savefig(self, fname: Any, **_: Any) -> None:
        """Write the last picture."""
        canvas: Any = self.canvas
        fname.write(canvas.buffer_rgba())


def animate(text: str, run: Drawn, path: Path, film: Film) -> None:
    """Write a film of a run with all its vehicles.

    Args:
        text: heading.
        run: with the ports of its vehicles, and of their planners if there are references.
        path: of a .gif, or of an .mp4 if ffmpeg is installed.
        film: options.

    Raises:
        InputError: the film cannot be written.

    """
    film.check(path)
    with styled():
        width, height = film.size
        figure = _Drawn(figsize=(width / film.dpi, height / film.dpi), dpi=film.dpi)
        pictures = _pictures(figure, text, run, film)
        if path.suffix == ".gif":
            frames = (Image.fromarray(picture[:, :, :3].copy()) for picture in pictures)
            first = next(frames).quantize(256, method=Image.Quantize.MAXCOVERAGE)
            # With one palette for all frames, colours do not flicker.
            rest = (frame.quantize(palette=first, dither=Image.Dither.NONE) for frame in frames)
            first.save(path, save_all=True, append_images=rest, duration=1000 // film.fps, loop=0)
            return
        writer = FFMpegWriter(film.fps, extra_args=[*_ENCODING])
        try:
            with writer.saving(figure, str(path), film.dpi):
                for _ in pictures:
                    writer.grab_frame()
        except (OSError, CalledProcessError) as error:
            raise InputError(f"{path}: ffmpeg could not write it") from error


def _pictures(figure: Figure, text: str, run: Drawn, film: Film) -> Iterator[np.ndarray]:
    """Draw and yield each frame of the figure; the background is drawn once."""
    canvas: Any = FigureCanvasAgg(figure)
    time = run.result.time
    duration = _DURATION if film.speed is None else float(np.ptp(time)) / film.speed
    instants = np.linspace(time[0], time[-1], max(2, round(duration * film.fps)))
    figure.suptitle(heading(text))
    grid = figure.add_gridspec(1, 2, width_ratios=(1.5, 1))
    space = figure.add_subplot(grid[0], projection="3d")
    move = _draw_scene(space, run)
    panels = _draw_panels(figure, grid[1], run)
    list_events(figure, [run], grow=False)
    cursors = [
        axes.axvline(time[0], color="black", linewidth=1.0, animated=True) for axes in panels
    ]
    canvas.draw()
    figure.set_layout_engine("none")
    background = canvas.copy_from_bbox(figure.bbox)
    for row in np.searchsorted(time, instants).clip(0, len(time) - 1).tolist():
        canvas.restore_region(background)
        for artist in move(row):
            space.draw_artist(artist)
        for axes, cursor in zip(panels, cursors, strict=True):
            cursor.set_xdata([time[row]] * 2)
            axes.draw_artist(cursor)
        yield np.asarray(canvas.buffer_rgba())


def _draw_scene(axes: Any, run: Drawn) -> Callable[[int], list[Any]]:
    """Draw the background; return a function that moves the vehicles to a row and returns them."""
    table, n = run.result, len(run.loops)
    stride = -(-len(table) // _POINTS)
    paths = [true_control_point(table, loop) for loop in run.loops]
    drawn = list(paths)
    references = reference_colours(run.loops) if n > 1 else [REFERENCE]
    for y_d, colour in dict(zip((loop.y_d for loop in run.loops), references, strict=True)).items():
        if not table.missing(y_d):
            drawn.append(table.group(*y_d))
            axes.plot(*drawn[-1][::stride].T, color=colour, linestyle="--", linewidth=0.8)
    points = np.vstack(drawn)
    frame_path(axes, points, run.z_up)
    ell = max(real_parameter(table, loop.ell) for loop in run.loops)
    extent = float((np.nanmax(points, axis=0) - np.nanmin(points, axis=0)).max())
    faces, part = _body(max(_SHARE * extent / n**0.5, _LENGTH * ell), run.z_up)
    trails, hulls = [], []
    for loop, colour in zip(run.loops, vehicle_colours(n), strict=True):
        trails += axes.plot([], [], [], color=colour, label=loop.name, animated=True)
        paint = np.array([colour if n > 1 else _HULL, _UPPER, _OTHER])[part]
        hulls.append(Poly3DCollection(faces, facecolors=paint, animated=True, **_EDGES))
        axes.add_collection3d(hulls[-1], autolim=False)
    if 1 < n <= _MOST_NAMED:
        axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.94))
    caption = axes.text2D(0.0, 1.0, "", transform=axes.transAxes, va="top", animated=True)

    def move(row: int) -> list[Any]:
        caption.set_text(f"t = {table.time[row]:.1f} s")
        for loop, y, trail, hull in zip(run.loops, paths, trails, hulls, strict=True):
            trail.set_data_3d(*y[: row + 1 : stride].T)
            euler = table.group(*loop.attitude)[row].tolist()
            hull.set_verts(y[row] + faces @ np.array(rotation_from_euler(*euler)).T)
            hull.do_3d_projection()
        return [*trails, *hulls, caption]

    return move


def _body(length: float, z_up: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces of a vehicle with its nose at the origin.

    Returns:
        Corners in body axes, and the part of each face: 0 hull, 1 upper fin, 2 other fins.

    """
    angles = 2.0 * np.pi * np.arange(_SIDES + 1) / _SIDES
    rings = np.array([[(-x, r * np.cos(a), r * np.sin(a)) for a in angles] for x, r in RINGS])
    hull = np.stack((rings[:-1, :-1], rings[:-1, 1:], rings[1:, 1:], rings[1:, :-1]), axis=2)
    # Up, to starboard, down, to port: z is down.
    sides = (0, -1), (1, 0), (0, 1), (-1, 0)
    fins = [[(-x, height * y, height * z) for x, height in FIN] for y, z in sides]
    faces = length * np.concatenate((hull.reshape(-1, 4, 3), fins))
    part = np.array([0] * (len(faces) - len(fins)) + [1, 2, 2, 2])
    return faces * ((1.0, -1.0, -1.0) if z_up else 1.0), part


def _draw_panels(figure: Figure, place: SubplotSpec, run: Drawn) -> list[Any]:
    """Draw the panels next to the scene for which there are signals; return their axes."""
    shares = {
        panel: share
        for panel, share in _PANELS[len(run.loops) > 1].items()
        if any(not run.result.missing(*panel.needs(loop)) for loop in run.loops)
    }
    before = len(figure.axes)
    if shares:
        grid = place.subgridspec(len(shares), 1, height_ratios=list(shares.values()))
        for i, panel in enumerate(shares):
            panel.draw(Cell(figure, grid[i]), [run])
    return figure.axes[before:]
