"""Vectors against numpy."""

import numpy as np
import pytest
from hypothesis import given

from auv_fmu.language.vectors import (
    add,
    add_scaled,
    add_two_scaled,
    distance,
    neg_diag,
    norm,
    scale,
    sub,
    sub_diag,
    sub_scaled,
)
from support.strategies import speeds, vectors

three = vectors(speeds, 3)


@given(a=three, b=three)
def test_difference_distance_and_norm(a, b):
    assert sub(a, b) == tuple(np.subtract(a, b))
    assert distance(a, b) == norm(sub(a, b))
    assert norm(a) == pytest.approx(np.linalg.norm(a), rel=1e-14, abs=1e-150)


@given(a=three, b=three, D=three, k=speeds)
def test_sums_and_products(a, b, D, k):
    """Each operation is rounded by itself, in numpy too."""
    a_, b_, D_ = map(np.array, (a, b, D))
    assert add(a, b) == tuple(a_ + b_)
    assert scale(k, a) == tuple(k * a_)
    assert add_scaled(a, k, b) == tuple(a_ + k * b_)
    assert add_two_scaled(a, k, b, D[0], D) == tuple(a_ + k * b_ + D[0] * D_)
    assert sub_scaled(a, k, b) == tuple(a_ - k * b_)
    assert sub_diag(a, D, b) == tuple(a_ - np.diag(D) @ b_)
    assert neg_diag(D, a) == tuple(-np.diag(D) @ a_)
