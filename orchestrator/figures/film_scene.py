"""What a camera sees in a film: vehicles with their trails and references above a ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb

from auv_fmu.paper.attitude import rotation_from_euler
from orchestrator.figures.body import PAINT, Z_UP, body, paint_of
from orchestrator.figures.style import COLOURS, REFERENCE, Drawn, reference_colours, vehicle_colours
from orchestrator.figures.visible import moving_mean
from orchestrator.vehicle.signals import Loop, real_parameter, true_control_point

#: What the camera sees is as wide as this many ell, and wider where the reference is far away: by
#: this factor of the distance.
_NEAREST, _SEPARATION = 14.0, 1.7

#: Time over which the camera adapts, as a share of the run.
_INERTIA = 0.05

#: Half the width and height of the picture, and of that part of it in which several vehicles stay;
#: 1 is what the camera sees.
_HALF, _WITHIN = (0.5, 0.56), (0.4, 0.44)

#: Length of the vehicle as a share of what the camera sees: to scale it would be a dot. That of one
#: of several is smaller, by the square root of their number.
_VEHICLE, _VEHICLES = 0.3, 0.2

#: Distance of the camera in widths of what it sees, and its direction, north-east-down.
_DISTANCE = 2.2
_DIRECTION = np.array([-0.75, -0.5, -0.45])

#: What is nearer to the camera than this many widths is behind it.
_BEHIND = 0.2

#: Lines of the ground on either side of the camera's middle, and its depth below it in widths.
_GROUND_LINES, _GROUND_DEPTH = 7, 0.4


class Scene:
    """What a camera sees that follows a vehicle, or has several in sight.

    Attributes:
        axes: that are drawn into.

    """

    def __init__(self, axes: Any, run: Drawn, rows: np.ndarray) -> None:
        """Prepare what moves.

        Args:
            axes: to draw into.
            run: whose vehicles are shown.
            rows: of its table that paths are drawn through.

        """
        self.axes = axes
        self._time = run.result.time[rows]
        # All is seen in axes whose z is down.
        self._turn = Z_UP if run.z_up else np.ones(3)
        axes.set(xlim=(-_HALF[0], _HALF[0]), ylim=(-_HALF[1], _HALF[1]))
        axes.set(aspect="equal", adjustable="box")
        axes.set_axis_off()
        if len(run.loops) == 1:
            looks = [_Look(COLOURS[0], REFERENCE, PAINT, _VEHICLE)]
        else:
            share = _VEHICLES / len(run.loops) ** 0.5
            colours = zip(
                vehicle_colours(len(run.loops)), reference_colours(run.loops), strict=True
            )
            looks = [_Look(own, other, paint_of(own), share) for own, other in colours]
        self._vehicles = [
            _Vehicle(axes, run, loop, rows, look)
            for loop, look in zip(run.loops, looks, strict=True)
        ]
        nearest = _NEAREST * max(real_parameter(run.result, loop.ell) for loop in run.loops)
        choose = _follow if len(run.loops) == 1 else _keep_in_sight
        self._middle, self._width = choose(self._time, self._vehicles, nearest)
        self._ground = LineCollection([], colors="#d5dde3", linewidths=0.8)
        axes.add_collection(self._ground, autolim=False)
        self._caption = axes.text(0.0, 1.0, "", transform=axes.transAxes, va="top")
        self._marks = [axes.text(0, 0, k, ha="center", va="center", color="#5b6b76") for k in "NE"]
        for artist in self._all(self._vehicles):
            artist.set_animated(True)

    def _all(self, vehicles: Sequence[_Vehicle]) -> list[Any]:
        """From back to front: nothing that belongs to one vehicle hides the hull of another."""
        layers = zip(*(vehicle.artists for vehicle in vehicles), strict=True)
        moving = [artist for layer in layers for artist in layer]
        return [self._ground, *moving, self._caption, *self._marks]

    def camera(self, i: int) -> Camera:
        """The camera at one of the rows."""
        return Camera.at(self._middle[i], float(self._width[i]))

    def artists(self, i: int) -> list[Any]:
        """What to draw at one of the rows, from back to front."""
        camera, middle = self.camera(i), self._middle[i]
        spacing = self._show_ground(camera, middle)
        depth = middle[2] + _GROUND_DEPTH * camera.width
        for vehicle in self._vehicles:
            vehicle.show(camera, i, depth)
        lines = [f"t = {self._time[i]:.1f} s", f"grid {spacing:g} m"]
        if len(self._vehicles) == 1:
            z = self._vehicles[0].y[i, 2] * self._turn[2]
            up = "up" if self._turn[2] < 0.0 else "down"
            lines.insert(1, f"z = {z:.1f} m (z {up})")
        self._caption.set_text("\n".join(lines))
        return self._all(sorted(self._vehicles, key=lambda one: -one.distance(camera, i)))

    def _show_ground(self, camera: Camera, middle: np.ndarray) -> float:
        """Draw a grid that stands still while the camera moves; its spacing [m]."""
        width = camera.width
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


class _Look(NamedTuple):
    """How a vehicle is drawn.

    Attributes:
        trail: colour of what it has passed.
        reference: colour of its reference.
        paint: of its body, for :data:`.PAINT`.
        share: its length as a share of what the camera sees.

    """

    trail: str
    reference: str
    paint: tuple[str, str, str]
    share: float


class _Vehicle:
    """A vehicle, its trail and its reference.

    Attributes:
        y: its control point in the earth frame whose z is down, (rows, 3) [m].
        y_d: its reference; None: it has none.
        artists: from back to front.

    """

    def __init__(self, axes: Any, run: Drawn, loop: Loop, rows: np.ndarray, look: _Look) -> None:
        table = run.result
        self._turn = Z_UP if run.z_up else np.ones(3)
        self.y = true_control_point(table, loop)[rows] * self._turn
        self._euler = table.group(*loop.attitude)[rows]
        has_none = table.missing(loop.y_d)
        self.y_d = None if has_none else table.group(*loop.y_d)[rows] * self._turn
        self._body, self._look = body(), look
        self._reference = LineCollection([], colors=look.reference, linewidths=1.0, linestyles="--")
        self._trail = LineCollection([], colors=look.trail, linewidths=1.8)
        self._drop = LineCollection([], colors="#9aa7b0", linewidths=0.8, linestyles=":")
        self._hull = PolyCollection([], edgecolors="face", linewidths=0.3)
        size = 6 if look.paint is PAINT else 4
        (self._target,) = axes.plot([], [], "s", color=look.reference, markersize=size)
        for collection in (self._reference, self._trail, self._drop, self._hull):
            axes.add_collection(collection, autolim=False)
        self.artists = [self._drop, self._reference, self._trail, self._target, self._hull]

    @property
    def points(self) -> list[np.ndarray]:
        """What is to be in sight: the control point and its reference, each (rows, 3)."""
        return [self.y] if self.y_d is None else [self.y, self.y_d]

    def distance(self, camera: Camera, i: int) -> float:
        """How far from a camera it is at one of the rows [m]."""
        return float(camera.project(self.y[i : i + 1])[1][0])

    def show(self, camera: Camera, i: int, depth: float) -> None:
        """Put it where it is at one of the rows, above a ground at a depth [m]."""
        self._trail.set_segments(camera.line(self.y[: i + 1]))
        if self.y_d is not None:
            self._reference.set_segments(camera.line(self.y_d))
            self._target.set_data(*camera.project(self.y_d[i : i + 1])[0].T)
        below = self.y[i].copy()
        below[2] = depth
        self._drop.set_segments(camera.line(np.array([self.y[i], below])))
        self._show_body(camera, i, self._look.share * camera.width)

    def _show_body(self, camera: Camera, i: int, length: float) -> None:
        R = np.array(rotation_from_euler(*self._euler[i].tolist())).T
        # Of a body whose axes are turned as the earth's are.
        R *= np.outer(self._turn, self._turn)
        points = self.y[i] + length * self._body.points @ R.T
        corners = points[self._body.triangles]
        seen, depth = camera.project(corners.reshape(-1, 3))
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        # Light from above; a triangle has two sides.
        light = 0.45 + 0.55 * np.abs(normals @ np.array([0.3, -0.35, -0.89]))
        colours = np.array([to_rgb(colour) for colour in self._look.paint])[self._body.part]
        order = np.argsort(-depth.reshape(-1, 3).mean(axis=1))
        self._hull.set_verts(list(seen.reshape(-1, 3, 2)[order]))
        self._hull.set_facecolor((colours * light[:, np.newaxis])[order].clip(0, 1))


def _follow(
    time: np.ndarray, vehicles: Sequence[_Vehicle], nearest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where the camera looks that follows one vehicle, (rows, 3), and how wide, (rows,) [m]."""
    [vehicle] = vehicles
    middle, width = vehicle.y, np.full(len(time), nearest)
    if vehicle.y_d is not None:
        middle = 0.5 * (vehicle.y + vehicle.y_d)
        distance = np.linalg.norm(vehicle.y - vehicle.y_d, axis=1)
        width = np.maximum(nearest, _SEPARATION * distance)
    window = _INERTIA * float(np.ptp(time))
    return _smooth(time, middle, window), moving_mean(time, width, window)


def _keep_in_sight(
    time: np.ndarray, vehicles: Sequence[_Vehicle], nearest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where the camera looks that has all of several vehicles and their references in sight."""
    points = np.stack([points for vehicle in vehicles for points in vehicle.points], axis=1)
    window = _INERTIA * float(np.ptp(time))
    middle = _smooth(time, 0.5 * (points.min(axis=1) + points.max(axis=1)), window)
    # A point is seen at DISTANCE r / (DISTANCE width + ahead), from which the width follows.
    right, up, ahead = np.moveaxis((points - middle[:, np.newaxis]) @ Camera.axes_of().T, 2, 0)
    needed = np.maximum(np.abs(right) / _WITHIN[0], np.abs(up) / _WITHIN[1]) - ahead / _DISTANCE
    # What is half as far away as the middle is twice as large.
    needed = np.maximum(needed, -2.0 * ahead / _DISTANCE)
    width = np.maximum(nearest, needed.max(axis=1))
    # The mean over a window of what is widest in a longer one is nowhere too narrow.
    reach = 0.5 * window + float(np.diff(time).max(initial=0.0))
    first, last = np.searchsorted(time, time - reach), np.searchsorted(time, time + reach, "right")
    widest = [width[i:j].max() for i, j in zip(first.tolist(), last.tolist(), strict=True)]
    return middle, moving_mean(time, np.array(widest), window)


def _smooth(time: np.ndarray, points: np.ndarray, window: float) -> np.ndarray:
    return np.column_stack([moving_mean(time, column, window) for column in points.T])


class Camera(NamedTuple):
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
    def at(cls, middle: np.ndarray, width: float) -> Camera:
        """A camera that looks at a point, and sees this width there [m]."""
        axes = cls.axes_of()
        return cls(middle - _DISTANCE * width * axes[2], axes, width)

    @staticmethod
    def axes_of() -> np.ndarray:
        """The axes of all cameras, which look in one direction."""
        ahead = -_DIRECTION / np.linalg.norm(_DIRECTION)
        right = np.cross(np.array([0.0, 0.0, 1.0]), ahead)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(right, ahead), ahead])

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
