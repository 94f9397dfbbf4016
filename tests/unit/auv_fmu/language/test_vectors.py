"""Vectors against numpy."""

import numpy as np
import pytest
from hypothesis import given

from auv_fmu.language.vectors import (
    difference,
    distance,
    minus_product,
    minus_scaled,
    minus_times,
    norm,
    plus_scaled,
    plus_two_scaled,
    scaled,
    total,
)
from support.strategies import speeds, vectors

three = vectors(speeds, 3)


@given(a=three, b=three)
def test_difference_distance_and_norm(a, b):
    assert difference(a, b) == tuple(np.subtract(a, b))
    assert distance(a, b) == norm(difference(a, b))
    assert norm(a) == pytest.approx(np.linalg.norm(a), rel=1e-14, abs=1e-150)


@given(a=three, b=three, D=three, k=speeds)
def test_sums_and_products(a, b, D, k):
    """Each operation is rounded by itself, in numpy too."""
    a_, b_, D_ = map(np.array, (a, b, D))
    assert total(a, b) == tuple(a_ + b_)
    assert scaled(k, a) == tuple(k * a_)
    assert plus_scaled(a, k, b) == tuple(a_ + k * b_)
    assert plus_two_scaled(a, k, b, D[0], D) == tuple(a_ + k * b_ + D[0] * D_)
    assert minus_scaled(a, k, b) == tuple(a_ - k * b_)
    assert minus_times(a, D, b) == tuple(a_ - np.diag(D) @ b_)
    assert minus_product(D, a) == tuple(-np.diag(D) @ a_)
