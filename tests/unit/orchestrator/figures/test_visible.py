"""Thinned rows keep what can be seen."""

from collections.abc import Collection
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from orchestrator.cosim import Ending, Experiment, Header
from orchestrator.figures.visible import VisibleRows, chatters, draw_signal, moving_mean

#: Rows of runs that are kept whole, and how many divisions they are first divided into.
WHOLE, DIVISIONS = 20_000, 200


def seen_of(rows: np.ndarray, block: int, watched: Collection[str] = ("a", "b", "c")):
    """Rows of an interrupted long run, taken in blocks."""
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
    """Compared with a search of the whole table."""
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
    # All are rows of the run, in order.
    assert (np.diff(seen.time) > 0).all()
    np.testing.assert_array_equal(seen.rows, rows[seen.time.astype(int)])


@pytest.mark.parametrize("n", [WHOLE + 1, 90_000])
@pytest.mark.parametrize("block", [7, 4096])
def test_rows_do_not_depend_on_the_size_of_blocks(n, block):
    rows = random_rows(2, n)
    first, second = seen_of(rows, 512), seen_of(rows, block)
    assert first.rows.tobytes() == second.rows.tobytes()
    assert first.means.rows.tobytes() == second.means.rows.tobytes()


@pytest.mark.parametrize("n", [1, 50, WHOLE])
def test_short_runs_are_kept_whole(n):
    rows = random_rows(1, n)
    seen = seen_of(rows, 512)
    np.testing.assert_array_equal(seen.rows, rows)
    assert seen.means is None


def test_an_interrupted_run_is_resolved_as_finely_as_a_complete_one():
    """30,000 steps of a million have hundreds of divisions, not ten."""
    seen = seen_of(random_rows(1, 30_000), 512)
    assert len(np.unique(seen.time // 150)) == 200


def test_means_are_taken_over_all_rows():
    """Spikes upwards are all extremes, so that the kept rows have quite another mean."""
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


TIME = 0.02 * np.arange(5001)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.random.default_rng(1).normal(size=5001), True),
        (np.where(np.arange(5001) % 2, 80.0, -80.0), True),
        (np.sin(2 * np.pi * TIME), False),
        (np.exp(-TIME), False),
        (np.zeros(5001), False),
        (1.0 / (1.0 + TIME) + 1e-9 * np.random.default_rng(1).normal(size=5001), False),
    ],
)
def test_a_signal_chatters_if_it_turns_at_every_other_step(values, expected):
    assert chatters(values) is expected


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.05, 20))
def test_mean_of_a_straight_line_is_the_line(a, b, window):
    """Compared at rows whose window is within the run."""
    inside = np.abs(TIME - TIME[2500]) < 50.0 - window
    mean = moving_mean(TIME, a + b * TIME, window)
    np.testing.assert_allclose(mean[inside], (a + b * TIME)[inside], atol=1e-9)


def test_mean_of_a_sine_is_smaller_by_the_known_factor():
    """Over a window w: sin(pi f w) / (pi f w), even if rows are missing."""
    keep = np.sort(np.random.default_rng(2).choice(5001, 4000, replace=False))
    time, w, f = TIME[keep], 1.0, 0.2
    mean = moving_mean(time, np.sin(2 * np.pi * f * time), w)
    inside = (time > w) & (time < 99.0)
    expected = np.sinc(f * w) * np.sin(2 * np.pi * f * time)
    np.testing.assert_allclose(mean[inside], expected[inside], atol=5e-3)


def test_the_drawn_mean_of_a_long_run_is_taken_over_all_its_rows():
    """Spikes upwards on a slow sine, 2000 s: a spike of 100 in every ten rows adds 10 to it."""
    n, w = 100_001, 20.0
    time = 0.02 * np.arange(n)
    slow = np.sin(2 * np.pi * time / 400.0)
    noise = np.random.default_rng(4).normal(size=n)
    values = slow + noise + np.where(np.arange(n) % 10 == 0, 100.0, 0.0)
    seen = VisibleRows({"a.x"})
    seen.begin(Header(("a.x",), Experiment(2000.0, 0.02)))
    seen.take(np.column_stack((time, values)))
    seen.end(Ending())
    axes = Figure().subplots()
    assert draw_signal(axes, seen, lambda table: (table.time, table["a.x"]), color="black")
    band, mean = axes.lines
    assert np.ptp(band.get_ydata()) > 100.0
    t, drawn = np.asarray(mean.get_xdata()), np.asarray(mean.get_ydata())
    assert (t[0], t[-1]) == (0.0, 2000.0)
    inside = (t > w) & (t < 2000.0 - w)
    expected = 10.0 + np.sinc(w / 400.0) * np.sin(2 * np.pi * t / 400.0)
    # The mean of 1000 rows of noise is 0.03 wide.
    np.testing.assert_allclose(drawn[inside], expected[inside], atol=0.2)
