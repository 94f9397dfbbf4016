"""A film shows what moves, in all its frames."""

from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from orchestrator.figures.animation import animate, check_film
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
    animate("title", Drawn("run", loop_table()), path, fps=2)
    frames = frames_of(path)
    assert len(frames) == 20
    assert all((a != b).any() for a, b in pairwise(frames))


@pytest.mark.parametrize(
    ("name", "fps", "text"), [("a.avi", 20, "must end with .gif"), ("a.gif", 0, "--fps 0")]
)
def test_films_that_cannot_be_written_are_refused(tmp_path, name, fps, text):
    with pytest.raises(InputError, match=text):
        check_film(tmp_path / name, fps)


# Several vehicles


def test_film_of_several_has_one_picture_with_the_colours_of_all(tmp_path):
    path = tmp_path / "film.gif"
    animate("title", Drawn("run", fleet_table(3), loops=fleet(3)), path, fps=2)
    frames = frames_of(path)
    assert len(frames) == 20
    assert all((a != b).any() for a, b in pairwise(frames))
    # Left of the panels and above the legend.
    scene = frames[-1][40:380, :380]
    for colour in vehicle_colours(3):
        rgb = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
        is_near = (np.abs(scene - rgb) < 12).all(axis=2)
        assert is_near.sum() > 20


def test_vehicle_without_a_reference_is_filmed_with_the_others(tmp_path):
    missing = fleet(2)[0].y_d
    run = Drawn("run", fleet_table(2, without=missing), loops=fleet(2))
    animate("title", run, tmp_path / "film.gif", fps=1)
    assert len(frames_of(tmp_path / "film.gif")) == 10
