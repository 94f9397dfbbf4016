"""Bins hold what they should, and equally much where that is up to them."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.figures.study_axes import bins_of, grouped, is_logarithmic


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.geomspace(1.0, 20.0, 50), True),
        (np.geomspace(1.0, 9.0, 50), False),
        ([0.0, *np.geomspace(1.0, 20.0, 50)], False),
        ([-1.0, 20.0], False),
        ([1e-9, *np.linspace(5.0, 20.0, 50)], False),
        ([1.0, np.nan, 100.0], True),
        ([np.nan], False),
    ],
)
def test_axis_is_logarithmic_where_a_linear_one_would_hide_most(values, expected):
    assert is_logarithmic(np.array(values)) is expected


@pytest.mark.parametrize("grid", [np.geomspace(0.5, 64.0, 7), np.linspace(-3.0, 5.0, 4), [2.0]])
def test_each_value_of_a_grid_has_a_bin(grid):
    bins = bins_of(np.repeat(grid, 3), 24)
    np.testing.assert_allclose(bins.centres, grid, rtol=1e-12)
    assert bins.places(np.array(grid)).tolist() == list(range(len(grid)))
    assert all(np.diff(bins.edges) > 0.0)


def test_bins_of_anything_else_are_equally_wide_or_equally_full():
    values = np.random.default_rng(1).lognormal(0.0, 2.0, 1000)
    full = bins_of(values, 10, are_full=True)
    assert full.is_logarithmic
    assert np.bincount(full.places(values)).tolist() == [100] * 10
    wide = bins_of(values, 10)
    np.testing.assert_allclose(np.diff(np.log(wide.edges)), np.ptp(np.log(values)) / 10)


def test_groups_are_the_finite_values_of_each_bin():
    random = np.random.default_rng(2)
    places, values = random.integers(0, 5, 40), random.normal(size=40)
    values[::7] = np.nan
    places[places == 3] = 4
    for place, group in enumerate(grouped(places, values, 6)):
        expected = [v for p, v in zip(places, values, strict=True) if p == place and np.isfinite(v)]
        assert sorted(group) == sorted(expected)
