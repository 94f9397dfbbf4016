"""The film's camera is a pinhole, and its vehicle has its parts where they belong."""

from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from orchestrator.figures.animation import animate, check_film
from orchestrator.figures.body import body
from orchestrator.figures.film_scene import Camera
from orchestrator.figures.style import Drawn
from orchestrator.machine.errors import InputError
from support.tables import loop_table


def test_camera_sees_what_it_looks_at_in_the_middle():
    middle = np.array([3.0, -2.0, 5.0])
    camera = Camera.at(middle, 7.0)
    seen, ahead = camera.project(middle[np.newaxis])
    np.testing.assert_allclose(seen, [[0.0, 0.0]], atol=1e-12)
    # One width to the right is one wide; up is against z, which points down.
    right, _, _ = camera.axes
    [[x, y], [_, above]], _ = camera.project(np.array([middle + 7.0 * right, middle - [0, 0, 1]]))
    assert (x, y) == pytest.approx((1.0, 0.0))
    assert above > 0.0
    assert right[2] == pytest.approx(0.0)
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)


def test_what_is_twice_as_far_away_is_half_as_large():
    camera = Camera.at(np.zeros(3), 1.0)
    right, _, ahead = camera.axes
    points = np.array([camera.place + d * ahead + 0.1 * right for d in (1.0, 2.0)])
    (near, far), distance = camera.project(points)
    assert near[0] == pytest.approx(2.0 * far[0])
    np.testing.assert_allclose(distance, [1.0, 2.0])


def test_lines_behind_the_camera_are_not_drawn():
    camera = Camera.at(np.zeros(3), 1.0)
    ahead = camera.axes[2]
    t = np.linspace(-1.0, 3.0, 41)
    pieces = camera.line(camera.place + t[:, np.newaxis] * ahead)
    assert sum(map(len, pieces)) < len(t)
    assert len(pieces) == 1


def test_body_is_as_long_as_one_and_its_upper_fin_is_above():
    shape = body()
    x = shape.points[:, 0]
    assert (x.min(), x.max()) == (-1.0, 0.0)
    upper = shape.points[np.unique(shape.triangles[shape.part == 1])]
    # z points down.
    assert (upper[:, 2] < 0.0).all()
    np.testing.assert_allclose(upper[:, 1], 0.0)


def test_film_has_a_frame_for_each_instant(tmp_path):
    path = tmp_path / "film.gif"
    animate("title", Drawn("run", loop_table()), path, fps=2)
    with Image.open(path) as film:
        frames = []
        for k in range(film.n_frames):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB"), dtype=int))
    assert len(frames) == 20
    assert all((a != b).any() for a, b in pairwise(frames))


@pytest.mark.parametrize(
    ("name", "fps", "text"), [("a.avi", 20, "must end with .gif"), ("a.gif", 0, "--fps 0")]
)
def test_films_that_cannot_be_written_are_refused(tmp_path, name, fps, text):
    with pytest.raises(InputError, match=text):
        check_film(tmp_path / name, fps)
