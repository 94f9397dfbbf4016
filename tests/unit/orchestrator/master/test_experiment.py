"""t_k = k h, and the stop time is the last."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.errors import InputError
from orchestrator.master.experiment import Experiment


@given(step=st.floats(1e-3, 1.0), n=st.integers(1, 200), rest=st.floats(0.0, 0.99))
def test_steps_follow_each_other_and_end_at_the_stop_time(step, n, rest):
    experiment = Experiment((n + rest) * step, step)
    steps = list(experiment.steps())
    assert len(steps) == experiment.rows - 1
    for k, (t, h, end) in enumerate(steps):
        assert t == k * step
        assert end == (k + 1) * step or k == len(steps) - 1
        assert h == pytest.approx(end - t, rel=1e-9)
    assert steps[-1][2] == pytest.approx(experiment.stop_time, rel=1e-9)


def test_a_rest_within_rounding_is_no_step():
    assert Experiment(0.3, 0.1).rows == 4
    assert Experiment(1.0, 0.03).rows == 35


@pytest.mark.parametrize("values", [(0.0, 0.1), (1.0, -0.1), (float("nan"), 0.1), (1.0, 0.0)])
def test_impossible_experiments_are_refused(values):
    with pytest.raises(InputError, match="must be positive"):
        Experiment(*values)


def test_text_is_no_time():
    with pytest.raises(InputError, match="must be numbers, not '3'"):
        Experiment("3", 0.1)  # type: ignore[arg-type]


def test_an_unknown_order_is_refused():
    with pytest.raises(InputError, match="use one of gauss-seidel, jacobi"):
        Experiment(1.0, 0.1, "random")
