"""Communication points are t_k = k h; the stop time is the last."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import ceil, floor

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from orchestrator.cosim.experiment import MOST_STEPS, Experiment
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import load


@given(step=st.floats(1e-3, 1.0), n=st.integers(1, 200), rest=st.floats(0.0, 0.99))
def test_steps_follow_each_other_and_end_at_the_stop_time(step, n, rest):
    experiment = Experiment((n + rest) * step, step)
    steps = list(experiment.steps())
    assert len(steps) == experiment.rows - 1
    for i, (k, t, h, end) in enumerate(steps):
        assert k == i + 1
        assert t == experiment.time(i) == i * step
        assert end == experiment.time(k)
        assert end == k * step or k == len(steps)
        assert h == pytest.approx(end - t, rel=1e-9)
    assert steps[-1][3] == pytest.approx(experiment.stop_time, rel=1e-9)


@given(stop_time=st.floats(5e-324, 1.7e308), step=st.floats(5e-324, 1.7e308))
@example(5e-324, 1e308)
@example(1e-300, 0.02)
@example(4.0, 1e12)
@example(1.7e308, 1.7e308)
@example(5e8 + 0.6, 1.0)
@example(1e7, 0.01)
def test_the_number_of_steps_follows_exact_arithmetic(stop_time, step):
    """Two neighbouring answers are allowed where only rounding prevents a whole number."""
    exact = Fraction(stop_time) / Fraction(step)
    if exact > MOST_STEPS:
        with pytest.raises(InputError, match="more than"):
            Experiment(stop_time, step)
        return
    experiment = Experiment(stop_time, step)
    rest = exact - floor(exact)
    near = min(Fraction(1, 1000), exact * Fraction(1, 10**9))
    wanted = {ceil(exact)} if near < rest < 1 - near else {floor(exact), ceil(exact)}
    assert experiment.rows - 1 in wanted - {0}
    if experiment.rows < 1000:
        steps = list(experiment.steps())
        assert len(steps) == experiment.rows - 1
        assert all(h > 0.0 and t + h > 0.0 for _, t, h, _ in steps)


@given(
    time=st.floats(allow_nan=False) | st.integers(-(10**300), 10**300),
    start=st.floats(-1e308, 1e307),
    step=st.floats(5e-324, 1.7e308),
)
@example(1e308, -1e308, 1e-3)
@example(float("inf"), 0.0, 0.02)
def test_any_time_is_reached_after_some_steps_or_never(time, start, step):
    """Never means after more steps than any run has."""
    stop = max(start + step, float(np.nextafter(start, np.inf)))
    reached = Experiment(stop, stop - start, start_time=start).reaching(time)
    assert 0 <= reached <= MOST_STEPS + 1
    if reached == 0:
        assert time <= start + 1e-3 * (stop - start)


def test_a_rest_within_rounding_is_not_a_step():
    assert Experiment(0.3, 0.1).rows == 4
    assert Experiment(1.0, 0.03).rows == 35


@pytest.mark.parametrize("values", [(0.0, 0.1), (1.0, -0.1), (float("nan"), 0.1), (1.0, 0.0)])
def test_impossible_experiments_are_refused(values):
    with pytest.raises(InputError, match="must be positive"):
        Experiment(*values)


def test_a_number_beyond_all_floats_is_refused():
    with pytest.raises(InputError, match="must be smaller"):
        Experiment(10**400, 0.1)


def test_text_is_not_a_time():
    with pytest.raises(InputError, match="must be numbers, not '3'"):
        Experiment("3", 0.1)  # type: ignore[arg-type]


def test_an_unknown_order_is_refused():
    with pytest.raises(InputError, match="use one of feedthrough, gauss-seidel, jacobi"):
        Experiment(1.0, 0.1, "random")


def test_a_step_of_a_component_may_be_beyond_all_multiples():
    system = replace(load("fig4", "native"), steps={"plant": 1e308})
    with pytest.raises(InputError, match=r"steps of 1e\+308 s, which are not a multiple"):
        system.decimations(0.02)


@pytest.mark.parametrize(
    ("stop_time", "step", "start_time", "message"),
    [
        (1.0, 0.1, 5.0, "stop time 1 s must be after the start time, 5 s, and finite"),
        (0.0, 0.1, 0.0, "stop time 0 s must be positive, and finite"),
        (1.0, 0.0, 0.0, "step 0 s must be positive, and finite"),
        (1.0, -0.1, 0.0, "step -0.1 s must be positive, and finite"),
        (float("inf"), 0.1, 0.0, "stop time inf s must be positive, and finite"),
        (1.0, float("nan"), 5.0, "step nan s must be positive, and finite"),
    ],
)
def test_the_number_that_is_wrong_is_named(stop_time, step, start_time, message):
    with pytest.raises(InputError) as error:
        Experiment(stop_time, step, start_time=start_time)
    assert str(error.value) == message
