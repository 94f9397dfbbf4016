"""Thinned rows keep what can be seen."""

from collections.abc import Collection
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.figures.visible import VisibleRows
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.observer import Ending, Header

#: Rows of runs that are kept whole, and how many divisions they are first divided into.
WHOLE, DIVISIONS = 20_000, 200


def seen_of(rows: np.ndarray, block: int, watched: Collection[str] = ("a", "b", "c")):
    """What is kept of rows that come in blocks, of a run that should have gone on for long."""
    seen = VisibleRows(watched)
    seen.begin(Header(("a", "b", "c"), Experiment(1e6, 1.0)))
    for start in range(0, len(rows), block):
        # The array is used again afterwards.
        borrowed = rows[start : start + block].copy()
        seen.take(borrowed)
        borrowed[:] = np.nan
    seen.end(Ending())
    return seen


def random_rows(seed: int, n: int) -> np.ndarray:
    """A row a second."""
    rows = np.random.default_rng(seed).normal(size=(n, 4))
    rows[:, 0] = np.arange(n)
    return rows


@settings(max_examples=15)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(WHOLE + 1, 100_000),
    block=st.one_of(st.integers(50, 4000), st.just(100_000)),
    watched=st.sets(st.sampled_from("abc"), min_size=1),
)
def test_extremes_of_each_division_are_kept(seed, n, block, watched):
    """A straight search over the whole table, against rows that came in blocks."""
    rows = random_rows(seed, n)
    seen = seen_of(rows, block, watched)
    size = WHOLE // DIVISIONS
    while n >= 2 * DIVISIONS * size:
        size *= 2
    for name in watched:
        column = 1 + "abc".index(name)
        values = set(seen[name])
        for start in range(0, n, size):
            part = rows[start : start + size, column]
            assert {part.min(), part.max()} <= values
    kept = set(seen.time)
    assert {0.0, n - 1.0} <= kept
    assert len(seen) <= 2 * DIVISIONS * 2 * (2 * len(watched) + 2) + 1
    # Rows are those of the run, in order.
    assert (np.diff(seen.time) > 0).all()
    np.testing.assert_array_equal(seen.rows, rows[seen.time.astype(int)])


@pytest.mark.parametrize("n", [WHOLE + 1, 90_000])
@pytest.mark.parametrize("block", [7, 4096])
def test_blocks_in_which_rows_come_change_nothing(n, block):
    rows = random_rows(2, n)
    one, other = seen_of(rows, 512), seen_of(rows, block)
    assert one.rows.tobytes() == other.rows.tobytes()
    assert one.means.rows.tobytes() == other.means.rows.tobytes()


@pytest.mark.parametrize("n", [1, 50, WHOLE])
def test_short_runs_are_kept_whole(n):
    rows = random_rows(1, n)
    seen = seen_of(rows, 512)
    np.testing.assert_array_equal(seen.rows, rows)
    assert seen.means is None


def test_an_interrupted_run_is_resolved_as_finely_as_a_complete_one():
    """Of a run of a million steps 30,000 were made: hundreds of divisions, not ten."""
    seen = seen_of(random_rows(1, 30_000), 512)
    assert len(np.unique(seen.time // 150)) == 200


def test_means_are_those_of_all_rows():
    """Of spikes upwards, which are all extremes: the kept rows have quite another mean."""
    n = 100_000
    rows = random_rows(3, n)
    rows[:, 1] = np.where(np.arange(n) % 10 == 0, 100.0, 0.0)
    seen = seen_of(rows, 512)
    assert seen["a"].mean() > 14.0
    means = seen.means
    # 100,000 rows in divisions of 400, the first row at the start of the first.
    ends = np.append(0, np.arange(399, n, 400))
    np.testing.assert_array_equal(means.time, ends)
    np.testing.assert_allclose(means["a"][1:], 10.0, atol=0.5)
    for column, name in enumerate("abc", 1):
        expected = [
            np.trapezoid(rows[start : end + 1, column]) / (end - start)
            for start, end in pairwise(ends)
        ]
        np.testing.assert_allclose(means[name][1:], expected, atol=1e-9)
