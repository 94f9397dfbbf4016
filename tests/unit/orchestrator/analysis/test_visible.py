"""Thinned rows keep what can be seen."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.analysis.visible import VisibleRows
from orchestrator.master.experiment import Experiment
from orchestrator.master.observer import Ending, Header

#: More rows than are kept whole, and the times into which they are divided.
LONG, DIVISIONS = 20_001, 400


@settings(max_examples=15)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(LONG, 40_000),
    block=st.integers(50, 4000),
    watched=st.sets(st.sampled_from("abc"), min_size=1),
)
def test_extremes_of_each_division_are_kept(seed, n, block, watched):
    """A straight search over the whole table, against rows that came in blocks."""
    rows = np.random.default_rng(seed).normal(size=(n, 4))
    rows[:, 0] = np.arange(n)
    seen = VisibleRows(watched, n)
    seen.begin(Header(("a", "b", "c"), Experiment(n - 1.0, 1.0)))
    for start in range(0, n, block):
        seen.take(rows[start : start + block])
    seen.end(Ending())
    size = -(-n // DIVISIONS)
    for name in watched:
        column = 1 + "abc".index(name)
        values = set(seen[name])
        for start in range(0, n, size):
            part = rows[start : start + size, column]
            assert {part.min(), part.max()} <= values
    kept = set(seen.time)
    assert {0.0, n - 1.0} <= kept
    assert len(seen) <= DIVISIONS * 2 * (2 * len(watched) + 2) + 1
    # Rows are those of the run, in order.
    assert (np.diff(seen.time) > 0).all()
    np.testing.assert_array_equal(seen.rows, rows[seen.time.astype(int)])


def test_short_runs_are_kept_whole():
    rows = np.column_stack((np.arange(50.0), np.zeros(50)))
    seen = VisibleRows((), 50)
    seen.begin(Header(("a",), Experiment(49.0, 1.0)))
    seen.take(rows)
    seen.end(Ending())
    np.testing.assert_array_equal(seen.rows, rows)
