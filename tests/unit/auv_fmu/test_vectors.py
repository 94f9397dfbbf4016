"""Vectors against numpy."""

import numpy as np
import pytest
from hypothesis import given

from auv_fmu.vectors import difference, distance, norm
from support.strategies import speeds, vectors

three = vectors(speeds, 3)


@given(a=three, b=three)
def test_difference_distance_and_norm(a, b):
    assert difference(a, b) == tuple(np.subtract(a, b))
    assert distance(a, b) == norm(difference(a, b))
    assert norm(a) == pytest.approx(np.linalg.norm(a), rel=1e-14, abs=1e-150)
