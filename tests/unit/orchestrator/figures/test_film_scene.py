"""The film's camera is a pinhole, and has in sight what it should."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from orchestrator.figures.film_scene import Camera, Scene
from orchestrator.figures.style import Drawn
from support.tables import fleet, fleet_table


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


@settings(max_examples=25)
@given(
    st.lists(st.tuples(*[st.floats(-200.0, 200.0)] * 3), min_size=2, max_size=5),
    st.floats(0.0, 50.0),
    st.booleans(),
)
# One is between the camera and the other.
@example([(75.0, 50.0, 45.0), (-75.0, -50.0, -45.0)], 0.0, False)
def test_camera_has_all_vehicles_and_references_in_sight(places, amplitude, z_up):
    """In each row all control points and references are in the picture, and none too near."""
    n = len(places)
    table = fleet_table(n, 100)
    for i, place in enumerate(places, 1):
        for axis, offset in zip("xyz", place, strict=True):
            for column in (f"auv{i}.plant.eta.{axis}", f"auv{i}.planner.y_d.{axis}"):
                table[column][:] = offset + amplitude * table[column]
    run = Drawn("run", table, z_up, fleet(n))
    scene = Scene(Figure().add_subplot(), run, np.arange(100))
    turn = [1.0, -1.0, -1.0] if z_up else [1.0, 1.0, 1.0]
    for row in range(100):
        values = {name: table[name][row] for name in table.columns}
        points = [
            [values[f"auv{i}.{group}.{axis}"] for axis in "xyz"]
            for i in range(1, n + 1)
            for group in ("plant.eta", "planner.y_d")
        ]
        camera = scene.camera(row)
        # The control point is 0.35 m from the centre, and half the picture is 0.5 wide.
        seen, ahead = camera.project(np.array(points) * turn)
        x, y = np.abs(seen).T
        assert max(x) < 0.5
        assert max(y) < 0.56
        # What is a tenth as far away as the middle would be ten times as large.
        assert min(ahead) > 0.2 * camera.width
