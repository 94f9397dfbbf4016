"""Definition 2 and Lemma 1."""

from math import asinh, cosh, exp, log, sinh, tanh

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.saturation import MAXIMUM_SLOPE, Saturation, integral, saturation
from auv_fmu.paper.saturation import slope as slopes_of
from support.strategies import vectors

numbers = st.floats(-50.0, 50.0)
positive = st.floats(0.01, 20.0)
every = pytest.mark.parametrize("name", MAXIMUM_SLOPE)
ROUNDING = 1e-12

#: Below it the products of numbers are rounded to no digits of their own.
SMALLEST = 1e-300


def s(name, xi):
    """s_i(xi)."""
    return saturation(name, (xi, 0.0, 0.0))[0]


def slope(name, xi):
    """s_i'(xi)."""
    x = (xi, 0.0, 0.0)
    return slopes_of(name, x, saturation(name, x))[0]


@every
@given(xi=vectors(numbers, 3))
def test_vectors_are_saturated_component_by_component(name, xi):
    values = saturation(name, xi)
    slopes = slopes_of(name, xi, values)
    assert values == tuple(s(name, xi_i) for xi_i in xi)
    assert slopes == tuple(slope(name, xi_i) for xi_i in xi)


@every
@given(xi=st.floats(allow_nan=False, allow_infinity=False), other=numbers)
def test_definition_2(name, xi, other):
    value = s(name, xi)
    assert abs(value) <= 1.0
    assert xi * value >= 0.0
    assert (value > 0) == (xi > 0) or abs(xi) < 1e-300
    assert (value <= s(name, other)) or xi > other


@every
@given(xi=numbers)
def test_slope_is_the_derivative(name, xi):
    h = 1e-5
    difference = (s(name, xi + h) - s(name, xi - h)) / (2 * h)
    assert slope(name, xi) == pytest.approx(difference, abs=1e-9)
    assert 0.0 <= slope(name, xi) <= MAXIMUM_SLOPE[name] == slope(name, 0.0)


@every
@given(xi=numbers, k=positive)
def test_lemma_1_i_and_ii(name, xi, k):
    """The integral of s(k r) from 0 to xi is the integral of s from 0 to k xi, over k."""
    area, s_M = integral(name, k * xi) / k, MAXIMUM_SLOPE[name]
    slack = ROUNDING * (1 + abs(area))
    assert s(name, k * xi) ** 2 / (2 * k * s_M) <= area + slack
    assert area <= k * s_M * xi**2 / 2 + slack
    assert area > 0.0 or abs(k * xi) < 1e-7
    # It grows without bound: s has its half of the bound at 1, and does not decrease.
    assert area >= 0.5 * (abs(xi) - 1.0 / k) - slack


@every
@given(xi=st.floats(-20.0, 20.0))
def test_integral_is_the_area_under_the_function(name, xi):
    """Simpson's rule on 2000 intervals."""
    nodes = np.linspace(0.0, xi, 2001)
    weights = np.ones(2001)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    area = weights @ [s(name, node) for node in nodes] * xi / 2000 / 3
    assert integral(name, xi) == pytest.approx(area, abs=1e-8)


@given(xi=st.floats(-20.0, 20.0))
def test_integral_of_tanh_is_the_logarithm_of_cosh(xi):
    assert integral(Saturation.TANH, xi) == pytest.approx(log(cosh(xi)), abs=1e-12)


@every
@given(x=numbers, y=numbers, k_1=positive, k_2=positive)
def test_lemma_1_iii(name, x, y, k_1, k_2):
    s_M = MAXIMUM_SLOPE[name]
    change = s(name, k_1 * x + k_2 * y) - s(name, k_2 * y)
    assert abs(change) <= s_M * k_1 * abs(x) + ROUNDING
    assert abs(s(name, x) - s(name, x - y)) <= s_M * abs(y) + ROUNDING


@every
@given(x=vectors(numbers, 3), k=positive, psi=vectors(positive, 3))
def test_lemma_1_iv_to_vi(name, x, k, psi):
    s_M = MAXIMUM_SLOPE[name]
    for xi in x:
        assert abs(s(name, k * xi)) <= s_M * k * abs(xi) * (1 + ROUNDING) + SMALLEST
        assert s(name, xi) ** 2 <= s_M * xi * s(name, xi) * (1 + ROUNDING)
        # As printed (vi) has no square on s'_M; by (iv) it belongs there.
        assert s(name, xi) ** 2 <= s_M**2 * xi**2 * (1 + ROUNDING)
    values = np.array(saturation(name, x))
    left = np.array(x) @ np.diag(psi) @ values
    assert left >= min(psi) * (values @ values) * (1 - ROUNDING)


def test_lemma_1_as_printed_fails():
    """(vi) without its square for 2 tanh(xi), s'_M = 2; (i) for ln(cosh(xi)) at k_1 = 2; (v)."""
    x, psi = np.array([10.0, -1.0]), np.array([[1.0, 5.0], [5.0, 26.0]])
    assert np.linalg.eigvalsh(psi)[0] > 0.0
    assert x @ psi @ np.tanh(x) == pytest.approx(-13.3, abs=0.05)
    assert (2.0 * tanh(0.1)) ** 2 > 2.0 * 0.1**2
    assert tanh(2.0 * 0.1) ** 2 / (2.0 * 2.0) > log(cosh(0.1))


@given(start=st.floats(-10.0, 10.0), t=st.floats(0.0, 20.0))
def test_a_saturated_error_falls_at_constant_speed_first(start, t):
    """de/dt = -tanh(e) has sinh(e) = sinh(e(0)) exp(-t): from 6 m it comes to 1.1 m in 5 s."""

    def e(start, t):
        return asinh(sinh(start) * exp(-t))

    rate = (e(start, t + 1e-5) - e(start, t - 1e-5)) / 2e-5
    assert rate == pytest.approx(-tanh(e(start, t)), abs=1e-6)
    assert e(6.0, 5.0) == pytest.approx(1.1, abs=0.05)


@every
@pytest.mark.parametrize("xi", [1e8, 1e9, 1e154, 1e160, 1.7e308])
def test_no_argument_is_too_large(name, xi):
    assert 1.0 - 1.0 / xi <= s(name, xi) == -s(name, -xi) <= 1.0
    assert 0.0 <= slope(name, xi) <= 1.0 / xi / xi
