"""Ocean currents: the profile over depth, and the statistics of its variation."""

from math import cos, exp, pi, sin, sqrt
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.water import ocean_current
from auv_fmu.water.ocean_current import Current, Variation

CURRENT = Current(speed=0.4, direction=0.6, mu=0.05, sigma=0.1)


@given(share=st.floats(0.0, 1.0), depth=st.floats(1.0, 5000.0))
def test_profile_is_the_seventh_root_of_the_height_above_the_bottom(share, depth):
    actual = ocean_current.profile(Current().root, share * depth, depth)
    assert actual**7 == pytest.approx(1.0 - share, abs=1e-12)


def test_profile_ends_at_the_bottom_and_is_even_in_deep_water():
    assert ocean_current.profile(7.0, 0.0, 50.0) == 1.0
    assert ocean_current.profile(7.0, 50.0, 50.0) == 0.0
    assert ocean_current.profile(7.0, 1e9, 0.0) == 1.0
    assert ocean_current.profile(0.0, 50.0, 50.0) == 1.0


@given(direction=st.floats(-pi, pi), z=st.floats(0.0, 50.0))
def test_current_is_level_and_goes_where_it_is_said_to_go(direction, z):
    current = CURRENT._replace(direction=direction)
    still = Variation(0.0, 0.0, 1.0)
    share = ocean_current.profile(current.root, z, 50.0)
    expected = (share * 0.4 * cos(direction), share * 0.4 * sin(direction), 0.0)
    actual = ocean_current.velocity(current, still, share)
    np.testing.assert_allclose(actual, expected, rtol=1e-14)


def series(current, steps):
    variation = ocean_current.begin(current)
    found = [variation[:2]]
    for h in steps:
        variation = ocean_current.advance(current, variation, h)
        found.append(variation[:2])
    return np.array(found)


def test_variation_has_its_deviation_and_its_correlation_time_whatever_the_steps():
    """exp(-mu lag), in steps of 1 s, and in steps of 0.1 s to 8 s that add up to 8.1 s in pairs.

    n values with a correlation r from one to the next are as good as n (1 - r) / (1 + r) free ones
    for the mean, n (1 - r^2) / (1 + r^2) for the variance. Five deviations are allowed.
    """
    n, random = 30_000, Random(1)
    even = series(CURRENT, [1.0] * n)
    halves = [random.uniform(0.1, 8.0) for _ in range(n)]
    uneven = series(CURRENT, [h for half in halves for h in (half, 8.1 - half)])[::2]
    for values, h in ((even, 1.0), (uneven, 8.1)):
        r = exp(-CURRENT.mu * h)
        assert abs(values.mean(axis=0)).max() < 5 * 0.1 * sqrt((1 + r) / (1 - r) / n)
        free = n * (1 - r * r) / (1 + r * r)
        np.testing.assert_allclose(values.var(axis=0), 0.1**2, rtol=5 * sqrt(2 / free))
        for lag in (1, 5, 20):
            found = np.mean(values[lag:] * values[:-lag], axis=0) / 0.1**2
            np.testing.assert_allclose(found, r**lag, atol=5 * sqrt(2 / free))
        cross = np.mean(values[:, 0] * values[:, 1]) / 0.1**2
        assert abs(cross) < 5 * sqrt(2 / free)


def test_variation_begins_in_its_stationary_distribution():
    starts = np.array([ocean_current.begin(CURRENT._replace(seed=k))[:2] for k in range(4000)])
    np.testing.assert_allclose(starts.var(axis=0), 0.1**2, rtol=5 * sqrt(2 / 4000))
    assert abs(starts.mean(axis=0)).max() < 5 * 0.1 / sqrt(4000)


def test_no_deviation_means_none():
    calm = CURRENT._replace(sigma=0.0)
    assert np.all(series(calm, [0.5, 1.0]) == 0.0)


@given(h=st.floats(1e-9, 1e12))
def test_kept_and_added_parts_make_up_the_same_variance(h):
    """x' = kept x + added n has kept^2 + added^2 = 1, for any step."""
    unit = Current(mu=0.05, sigma=1.0)
    none, one = (ocean_current.advance(unit, Variation(x, 0.0, 7.0), h).north for x in (0.0, 1.0))
    kept = one - none
    _, n = ocean_current.gaussian(7.0)
    assert kept**2 + (none / n) ** 2 == pytest.approx(1.0, abs=1e-9)
