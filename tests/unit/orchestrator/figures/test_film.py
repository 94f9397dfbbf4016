"""Films: frames, size, speed, vehicles."""

from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from orchestrator.figures.film import Film, _body, animate
from orchestrator.figures.style import Drawn, vehicle_colours
from orchestrator.machine.errors import InputError
from support.tables import fleet, fleet_table, loop_table


def frames_of(path):
    with Image.open(path) as film:
        frames = []
        for k in range(film.n_frames):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB"), dtype=int))
    return frames


def test_film_has_a_frame_for_each_instant(tmp_path):
    path = tmp_path / "film.gif"
    animate("title", Drawn("run", loop_table()), path, Film(fps=2))
    frames = frames_of(path)
    assert len(frames) == 20
    assert all((a != b).any() for a, b in pairwise(frames))


def test_size_and_speed(tmp_path):
    """The run lasts 8 s, less a step: at twice its speed, 4 s with 2 frames a second."""
    path = tmp_path / "film.gif"
    animate("title", Drawn("run", loop_table()), path, Film(2, (400, 300), 2.0))
    frames = frames_of(path)
    assert len(frames) == 8
    assert {frame.shape for frame in frames} == {(300, 400, 3)}


@pytest.mark.parametrize("z_up", [False, True])
def test_body_has_its_length_and_its_upper_fin_above_the_hull(z_up):
    faces, part = _body(2.0, z_up)
    assert (faces[..., 0].min(), faces[..., 0].max()) == (-2.0, 0.0)
    up = 1.0 if z_up else -1.0
    hull, [fin] = up * faces[part == 0][..., 2], up * faces[part == 1][..., 2]
    assert fin.min() > 0.0
    assert fin.max() > hull.max()


@pytest.mark.parametrize(
    ("name", "film", "text"),
    [
        ("a.avi", Film(), "must end with .gif"),
        ("a.gif", Film(fps=0), "--fps 0"),
        ("a.gif", Film(size=(100, 400)), "--size"),
        ("a.gif", Film(speed=0.0), "--speed 0"),
        ("a.gif", Film(speed=float("nan")), "--speed nan"),
    ],
)
def test_films_that_cannot_be_written_are_refused(tmp_path, name, film, text):
    with pytest.raises(InputError, match=text):
        film.check(tmp_path / name)


# Several vehicles


def test_film_of_several_has_one_picture_with_the_colours_of_all(tmp_path):
    path = tmp_path / "film.gif"
    animate("title", Drawn("run", fleet_table(3), loops=fleet(3)), path, Film(fps=2))
    frames = frames_of(path)
    assert len(frames) == 20
    assert all((a != b).any() for a, b in pairwise(frames))
    # Left of the panels and above the legend.
    scene = frames[-1][60:480, :480]
    for colour in vehicle_colours(3):
        rgb = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
        is_near = (np.abs(scene - rgb) < 12).all(axis=2)
        assert is_near.sum() > 20


def test_vehicle_without_a_reference_is_filmed_with_the_others(tmp_path):
    missing = fleet(2)[0].y_d
    run = Drawn("run", fleet_table(2, without=missing), loops=fleet(2))
    animate("title", run, tmp_path / "film.gif", Film(fps=1))
    assert len(frames_of(tmp_path / "film.gif")) == 10
