"""A run in motion: vehicle, reference and trail in three dimensions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from auv_fmu.attitude import rotation_from_euler
from orchestrator.analysis.figures import COLOURS, SETTINGS
from orchestrator.analysis.signals import ATTITUDE, Y_D, true_control_point
from orchestrator.errors import InputError
from orchestrator.master.table import Table

FRAMES_PER_SECOND = 20

#: Length of a film, whatever the length of the run [s].
_DURATION = 10.0

#: Length of the drawn vehicle as a share of the largest extent of the scene: to scale, half a
#: metre of vehicle could not be seen in a scene of a hundred.
_VEHICLE_SIZE = 0.12


def check_format(path: Path) -> None:
    """Check before a run that its film can be written.

    Raises:
        InputError: the format is unknown or not available.

    """
    if path.suffix not in (".gif", ".mp4"):
        raise InputError(f"{path}: write a .gif or an .mp4")
    if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise InputError(f"{path}: an .mp4 needs ffmpeg, which is not installed; write a .gif")


def animate(title: str, result: Table, path: Path) -> None:
    """Write a film of a run.

    Args:
        title: heading.
        result: with the ports of the plant, and of the planner if there is a reference.
        path: of a .gif, or of an .mp4 where ffmpeg is installed.

    Raises:
        InputError: the file cannot be written.

    """
    check_format(path)
    writer: Any = FFMpegWriter if path.suffix == ".mp4" else PillowWriter
    with mpl.rc_context({**SETTINGS, "figure.constrained_layout.use": False}):
        try:
            _film(title, result).save(path, writer=writer(fps=FRAMES_PER_SECOND), dpi=90)
        except OSError as error:
            raise InputError(f"cannot write {path}: {error}") from error


def _film(title: str, result: Table) -> FuncAnimation:
    frames = int(_DURATION * FRAMES_PER_SECOND)
    rows = np.linspace(0, len(result.time) - 1, frames).astype(int)
    y = true_control_point(result)
    euler = result.group(*ATTITUDE)
    paths = [y]
    if "planner.y_d.x" in result:
        paths.append(result.group(*Y_D))
    lower, upper = np.min(np.vstack(paths), axis=0), np.max(np.vstack(paths), axis=0)
    size = _VEHICLE_SIZE * float((upper - lower).max())
    figure = Figure(figsize=(7, 6))
    axes: Any = figure.add_subplot(projection="3d")
    axes.set(xlabel="x north [m]", ylabel="y east [m]", zlabel="z down [m]")
    # One scale on all axes: a helix must not look like a spring that was stretched.
    middle, half = (lower + upper) / 2, 0.5 * float((upper - lower).max()) + size
    for set_limits, centre in zip((axes.set_xlim, axes.set_ylim), middle[:2], strict=True):
        set_limits(centre - half, centre + half)
    axes.invert_yaxis()
    axes.set_zlim(middle[2] + half, middle[2] - half)
    (trail,) = axes.plot([], [], [], color=COLOURS[0], linewidth=1, label="control point")
    hull = [
        axes.plot([], [], [], color=COLOURS[0], linewidth=width, solid_capstyle="round")[0]
        for width in (5, 2)
    ]
    reference = None
    if len(paths) > 1:
        axes.plot(*paths[1].T, color="#555555", linestyle="--", linewidth=0.8, label="reference")
        (reference,) = axes.plot([], [], [], "s", color=COLOURS[1], label="reference now")
    axes.legend(loc="upper left", fontsize="small")
    caption = axes.set_title(title)

    def show(frame: int) -> list[Any]:
        row = int(rows[frame])
        trail.set_data_3d(*y[: row + 1].T)
        e1, e2, _ = (np.array(e) for e in rotation_from_euler(*euler[row].tolist()))
        stern = y[row] - size * e1
        # The body from stern to control point, and a crosspiece that shows the roll.
        for line, (a, b) in zip(
            hull,
            ((stern, y[row]), (stern - 0.25 * size * e2, stern + 0.25 * size * e2)),
            strict=True,
        ):
            line.set_data_3d(*np.array([a, b]).T)
        if reference is not None:
            reference.set_data_3d(*paths[1][row : row + 1].T)
        caption.set_text(f"{title}\nt = {result.time[row]:.1f} s")
        return [trail, *hull]

    return FuncAnimation(figure, show, frames=frames)
