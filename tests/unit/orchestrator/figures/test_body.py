"""The body has its parts where they belong."""

import numpy as np

from orchestrator.figures.body import PAINT, body, paint_of
from orchestrator.figures.style import vehicle_colours


def test_body_is_as_long_as_one_and_its_upper_fin_is_above():
    shape = body()
    x = shape.points[:, 0]
    assert (x.min(), x.max()) == (-1.0, 0.0)
    upper = shape.points[np.unique(shape.triangles[shape.part == 1])]
    # z points down.
    assert (upper[:, 2] < 0.0).all()
    np.testing.assert_allclose(upper[:, 1], 0.0)


def test_upper_fin_shows_in_every_colour_of_a_vehicle():
    for paint in (PAINT, *map(paint_of, vehicle_colours(20))):
        assert len(paint) == body().part.max() + 1
        assert paint[1] not in (paint[0], paint[2])
