"""Rows kept in memory, and the pairing of what acts in a step with the time of its beginning."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.experiment import Experiment, Order
from orchestrator.cosim.observers import Header, Table
from orchestrator.machine.errors import InputError


def table(times: list[float], order: Order = "gauss-seidel") -> Table:
    """`a.t` holds the time; `a.start` the time at which the step of the row began, 0.1 s before."""
    t = np.array(times)
    header = Header(("a.t", "a.start"), Experiment(10.0, 0.1, order), {PortName("a", "gain"): 2.0})
    return Table.of(header, np.column_stack([t, t, t - 0.1]))


def test_values_of_a_step_belong_to_the_time_at_which_it_began():
    whole = table([0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(whole.step_start, whole.step_values("a.start")[:, 0], atol=1e-15)
    np.testing.assert_allclose(whole.start_values("a.t")[:, 0], whole.step_start)


def test_steps_keep_their_times_where_rows_were_left_out():
    thinned = table([0.0, 0.1, 1.0, 1.1, 2.0])
    np.testing.assert_allclose(thinned.step_start, [0.0, 0.9, 1.0, 1.9])
    # The row before 1.0 is not there: its own values stand in, a step later.
    np.testing.assert_allclose(thinned.start_values("a.t")[:, 0], [0.0, 1.0, 1.0, 2.0])


def test_without_a_lag_values_of_a_step_stand_in_the_row_of_its_time():
    """The last row begins no step; where rows were left out, each has its own time."""
    for times in ([0.0, 0.1, 0.2, 0.3], [0.0, 0.1, 1.0, 1.1, 2.0]):
        whole = table(times, "feedthrough")
        assert whole.step_start.tolist() == times[:-1]
        assert whole.step_values("a.t")[:, 0].tolist() == times[:-1]
        assert whole.start_values("a.t")[:, 0].tolist() == times[:-1]


def test_unknown_column_has_a_suggestion():
    with pytest.raises(KeyError, match=r"did you mean a\.start"):
        table([0.0])["a.strat"]


def test_missing_names_what_is_not_there():
    assert table([0.0]).missing(["a.t", "b.x"], ["a.gain", "a.loss"]) == ["b.x", "a.loss"]


def test_more_rows_than_fit_are_refused_before_the_run():
    with pytest.raises(InputError, match="do not fit into memory"):
        Table().begin(Header(("a.t",), Experiment(1e6, 0.01)))
