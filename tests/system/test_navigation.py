"""The errors of the navigation filter in the loop have the covariance that it states."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from page_numbers import nees

pytestmark = pytest.mark.slow

RUNS, MOMENTS = 200, (2.0, 5.0, 10.0, 20.0)


def test_errors_have_their_covariance():
    found = nees(RUNS, {"dvl.bias.std": 0.0}, MOMENTS)
    for k, n in enumerate((3, 3, 3, 9)):
        low, high = chi2(n * RUNS).ppf([1e-3, 1 - 1e-3]) / RUNS
        means = found[:, :, k].mean(axis=1)
        assert (low < means).all() and (means < high).all(), means
    # Not only in the mean: as many runs as there should be are outside of each quantile.
    share = (found[-1, :, 3] > chi2(9).ppf(0.9)).mean()
    assert share == pytest.approx(0.1, abs=4 * np.sqrt(0.1 * 0.9 / RUNS))
