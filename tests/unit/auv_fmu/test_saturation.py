"""Definition 2 and Lemma 1."""

from math import cosh, log, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.saturation import INTEGRALS as OURS
from auv_fmu.saturation import MAXIMUM_SLOPE, SATURATIONS
from support.strategies import vectors

numbers = st.floats(-50.0, 50.0)
positive = st.floats(0.01, 20.0)
both = pytest.mark.parametrize("name", SATURATIONS)

#: Integral of s(k r) dr from 0 to xi, by hand.
INTEGRALS = {
    "tanh": lambda k, xi: (abs(k * xi) + np.log1p(np.exp(-2 * abs(k * xi))) - log(2)) / k,
    "algebraic": lambda k, xi: (sqrt(1 + (k * xi) ** 2) - 1) / k,
}
ROUNDING = 1e-12


@both
@given(xi=st.floats(allow_nan=False, allow_infinity=False), other=numbers)
def test_definition_2(name, xi, other):
    value = SATURATIONS[name](xi)[0]
    assert abs(value) <= 1.0
    assert xi * value >= 0.0
    assert (value > 0) == (xi > 0) or abs(xi) < 1e-300
    assert (value <= SATURATIONS[name](other)[0]) or xi > other


@both
@given(xi=numbers)
def test_slope_is_the_derivative(name, xi):
    s, h = SATURATIONS[name], 1e-5
    difference = (s(xi + h)[0] - s(xi - h)[0]) / (2 * h)
    assert s(xi)[1] == pytest.approx(difference, abs=1e-9)
    assert 0.0 <= s(xi)[1] <= MAXIMUM_SLOPE[name]


@both
@given(xi=numbers, k=positive)
def test_lemma_1_i_and_ii(name, xi, k):
    s, integral = SATURATIONS[name], INTEGRALS[name](k, xi)
    slope = MAXIMUM_SLOPE[name]
    slack = ROUNDING * (1 + abs(integral))
    assert s(k * xi)[0] ** 2 / (2 * k * slope) <= integral + slack
    assert integral <= k * slope * xi**2 / 2 + slack
    assert integral > 0.0 or abs(k * xi) < 1e-7
    assert integral >= abs(xi) - 1.0 / k - slack


@both
@given(xi=st.floats(-20.0, 20.0))
def test_integral_is_the_area_under_the_function(name, xi):
    """Simpson's rule on 2000 intervals."""
    nodes = np.linspace(0.0, xi, 2001)
    weights = np.ones(2001)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    area = weights @ [SATURATIONS[name](node)[0] for node in nodes] * xi / 2000 / 3
    assert OURS[name](xi) == pytest.approx(area, abs=1e-8)


@given(xi=st.floats(-20.0, 20.0))
def test_integral_of_tanh_is_the_logarithm_of_cosh(xi):
    assert INTEGRALS["tanh"](1.0, xi) == pytest.approx(log(cosh(xi)), abs=1e-12)


@both
@given(x=numbers, y=numbers, k_1=positive, k_2=positive)
def test_lemma_1_iii(name, x, y, k_1, k_2):
    s, slope = SATURATIONS[name], MAXIMUM_SLOPE[name]
    assert abs(s(k_1 * x + k_2 * y)[0] - s(k_2 * y)[0]) <= slope * k_1 * abs(x) + ROUNDING
    assert abs(s(x)[0] - s(x - y)[0]) <= slope * abs(y) + ROUNDING


@both
@given(x=vectors(numbers, 3), k=positive, psi=vectors(positive, 3))
def test_lemma_1_iv_to_vi(name, x, k, psi):
    s, slope = SATURATIONS[name], MAXIMUM_SLOPE[name]
    for xi in x:
        assert abs(s(k * xi)[0]) <= slope * k * abs(xi) * (1 + ROUNDING)
        assert s(xi)[0] ** 2 <= slope * xi * s(xi)[0] * (1 + ROUNDING)
        assert s(xi)[0] ** 2 <= slope * xi**2 * (1 + ROUNDING)
    values = np.array([s(xi)[0] for xi in x])
    left = np.array(x) @ np.diag(psi) @ values
    assert left >= min(psi) * (values @ values) * (1 - ROUNDING)
