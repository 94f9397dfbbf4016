"""Computations with vectors and matrices, against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.linear_algebra import interpolate, solve

XS, YS = Vector((-2.0, -0.5, 0.0, 1.0, 4.0)), Vector((3.0, -1.0, 0.0, 0.5, 0.25))


@given(st.floats(-10.0, 10.0))
def test_interpolation_is_numpys(x: float):
    assert interpolate(x, XS, YS) == pytest.approx(np.interp(x, XS, YS), rel=1e-14, abs=1e-15)


def test_interpolation_of_no_number_is_none():
    assert np.isnan(interpolate(float("nan"), XS, YS))


@given(st.integers(0, 10_000))
def test_solution_is_numpys(seed: int):
    random = np.random.default_rng(seed)
    A, b = random.normal(size=(4, 4)), random.normal(size=4)
    x = solve(Matrix(A), Vector(b))
    tolerance = 1e-14 * np.linalg.cond(A) * np.abs(x).max()
    np.testing.assert_allclose(x, np.linalg.solve(A, b), rtol=0.0, atol=tolerance)


def test_a_zero_on_the_diagonal_is_solved_and_a_singular_matrix_refused():
    assert solve(Matrix(((0.0, 1.0), (2.0, 0.0))), Vector((3.0, 4.0))) == (2.0, 3.0)
    with pytest.raises(ZeroDivisionError):
        solve(Matrix(((1.0, 2.0), (2.0, 4.0))), Vector((1.0, 1.0)))
