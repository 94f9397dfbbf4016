"""PathPlanner: the corner ahead, which is part of the state."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal
from auv_fmu.guidance import path_planner
from auv_fmu.guidance.path_planner import Parameters, Waypoints
from fmus.path_planner.component import check_state, start, update

paths = st.builds(
    lambda **values: Waypoints(**values),  # noqa: PLW0108
    timed=st.booleans(),
    rounding=st.floats(0.5, 40.0),
)  # all others keep their start values


@given(paths, st.floats(-10.0, 10.0), st.lists(st.floats(-20.0, 40.0), max_size=20))
def test_corner_ahead_is_the_one_that_is_found_from_the_start(waypoints, begun, steps):
    """Also where a host goes back."""
    parameters = Parameters(waypoints)
    state = start(parameters, begun)
    for h in steps:
        state = update(parameters, state, state.t, h)
        first = path_planner.first_corner(waypoints, begun)
        assert state.ahead == path_planner.corner_ahead(waypoints, first, state.t)
        check_state(parameters, state)


@pytest.mark.parametrize("change", [{"k": 2}, {"t": 3.5}])
def test_state_with_another_corner_is_refused(change):
    state = start(Parameters(), 0.0)
    with pytest.raises(Refusal, match="corner ahead"):
        check_state(Parameters(), state._replace(ahead=state.ahead._replace(**change)))
