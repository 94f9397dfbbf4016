"""Vectors and matrices against numpy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from auv_fmu.language.arrays import Matrix, Vector

numbers = st.floats(-1e6, 1e6)


def vectors(n: int) -> st.SearchStrategy[np.ndarray]:
    return arrays.arrays(float, n, elements=numbers)


def matrices(rows: int, columns: int) -> st.SearchStrategy[np.ndarray]:
    return arrays.arrays(float, (rows, columns), elements=numbers)


@given(vectors(4), vectors(4), numbers)
def test_vectors_are_added_and_scaled_like_numpys(v: np.ndarray, w: np.ndarray, x: float):
    first, second = Vector(v), Vector(w)
    assert first + second == tuple(v + w)
    assert first - second == tuple(v - w)
    assert -first == tuple(-v)
    assert x * first == first * x == tuple(x * v)
    assert first / 3.0 == tuple(v / 3.0)


@given(vectors(4), vectors(4))
def test_products_are_within_rounding_of_numpys(v: np.ndarray, w: np.ndarray):
    size = float(np.abs(v) @ np.abs(w))
    assert Vector(v) @ Vector(w) == pytest.approx(v @ w, abs=1e-15 * size, rel=0.0)
    assert Vector(v).sum() == pytest.approx(v.sum(), abs=1e-15 * np.abs(v).sum(), rel=0.0)


@given(matrices(2, 3), matrices(3, 4), vectors(3))
def test_matrices_multiply_like_numpys(A: np.ndarray, B: np.ndarray, v: np.ndarray):
    size = float((np.abs(A) @ np.abs(B)).max() + (np.abs(A) @ np.abs(v)).max())
    np.testing.assert_allclose(Matrix(A) @ Matrix(B), A @ B, rtol=0.0, atol=1e-15 * size)
    np.testing.assert_allclose(Matrix(A) @ Vector(v), A @ v, rtol=0.0, atol=1e-15 * size)
    np.testing.assert_array_equal(Matrix(A).T, A.T)
    np.testing.assert_array_equal(Matrix(A) + 2.0 * Matrix(A) - Matrix(A), A + 2.0 * A - A)
    assert Matrix(A)[1, 2] == Matrix(A)[1][2] == A[1, 2]


def test_nothing_is_changed_in_place():
    v, A = Vector((1, 2, 3)), Matrix(((1, 2), (3, 4)))
    assert v.replaced(-1, 9) == (1.0, 2.0, 9.0)
    assert A.replaced(0, Vector((5, 6))) == ((5.0, 6.0), (3.0, 4.0))
    assert (v, A) == ((1.0, 2.0, 3.0), ((1.0, 2.0), (3.0, 4.0)))
    assert all(type(x) is float for x in (*v, *A[0]))
    assert type(v[1:]) is Vector


def test_slices_and_elements_out_of_range_raise_as_a_tuples():
    with pytest.raises(IndexError, match="tuple index out of range"):
        Vector((1.0,)).replaced(1, 2.0)
    with pytest.raises(IndexError, match="tuple index out of range"):
        Matrix(((1.0,),))[0, 1]


def test_operands_of_different_sizes_are_refused():
    with pytest.raises(TypeError, match="a Vector of 2 and a Vector of 3 do not fit together"):
        Vector((1, 2)) + Vector((1, 2, 3))
    with pytest.raises(TypeError, match="a Vector times a Vector: use @, or a number"):
        Vector((1, 2)) * Vector((1, 2))
    with pytest.raises(TypeError, match="rows of 1, 2 elements"):
        Matrix(((1,), (1, 2)))
