"""Chatter is told from what moves slowly, and its mean is a mean."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from orchestrator.figures.signal import chatters, draw_signal, moving_mean
from orchestrator.figures.visible import VisibleRows
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.observer import Ending, Header

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
def test_chatter_is_what_turns_around_at_every_other_step(values, expected):
    assert chatters(values) is expected


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.05, 20))
def test_mean_of_a_straight_line_is_the_line(a, b, window):
    """Where the window lies within the run."""
    inside = np.abs(TIME - TIME[2500]) < 50.0 - window
    mean = moving_mean(TIME, a + b * TIME, window)
    np.testing.assert_allclose(mean[inside], (a + b * TIME)[inside], atol=1e-9)


def test_mean_of_a_sine_is_smaller_by_the_known_factor():
    """Over a window w: sin(pi f w) / (pi f w), also where rows are missing."""
    keep = np.sort(np.random.default_rng(2).choice(5001, 4000, replace=False))
    time, w, f = TIME[keep], 1.0, 0.2
    mean = moving_mean(time, np.sin(2 * np.pi * f * time), w)
    inside = (time > w) & (time < 99.0)
    expected = np.sinc(f * w) * np.sin(2 * np.pi * f * time)
    np.testing.assert_allclose(mean[inside], expected[inside], atol=5e-3)


def test_mean_that_is_drawn_of_a_long_run_is_that_of_all_its_rows():
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
