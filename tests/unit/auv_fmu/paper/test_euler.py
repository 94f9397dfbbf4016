"""The time after a step."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.paper.euler import end_of_step

TIMES = st.floats(-1e6, 1e6)
STEPS = st.floats(1e-6, 1e3)


@given(TIMES, STEPS, st.integers(0, 10**6))
def test_end_of_a_counted_step_is_where_the_next_begins(start, h, k):
    assert end_of_step(start, start + k * h, h) == start + (k + 1) * h


@given(TIMES, TIMES, STEPS)
def test_any_step_ends_after_its_length(start, t, h):
    assert end_of_step(start, t, h) == pytest.approx(t + h, rel=1e-15, abs=1e-9)


@pytest.mark.parametrize(
    ("start", "t", "h"), [(0.0, 1e300, 1e-300), (-1.7e308, 1.7e308, 1.0), (0.0, 1e20, 0.5)]
)
def test_steps_that_are_too_many_to_be_counted_end_too(start, t, h):
    assert end_of_step(start, t, h) == t + h < inf
