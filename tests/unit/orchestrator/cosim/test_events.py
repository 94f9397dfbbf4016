"""Events on signals: their times, their order, and their state after a resumption."""

from __future__ import annotations

import json
import operator
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.connection import Connection, PortName
from orchestrator.cosim.events import (
    Alter,
    Condition,
    Event,
    Events,
    Freeze,
    Release,
    Reset,
    Set,
    Stop,
)
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.instance import ComponentFailed, Ended
from orchestrator.cosim.hooks import NEVER
from orchestrator.cosim.row import Gathering, Overrides

OUT, FED, FREE = (PortName("a", name) for name in ("out", "fed", "free"))
GAIN = PortName("a", "gain")

EXPERIMENT = Experiment(10.0, 0.5)
STEPS = EXPERIMENT.rows - 1


class Component:
    """Holds a parameter and records calls."""

    def __init__(self, stubborn: bool = False) -> None:
        self.gain, self.stubborn, self.asked = 1.0, stubborn, []

    def read(self, ports):
        return {"gain": self.gain}

    def tune(self, values):
        if not self.stubborn:
            self.gain = values["gain"]

    def reset(self):
        self.asked.append("reset")

    def enter_initialization(self, values, start_time):
        self.asked.append(("enter", values, start_time))

    def exchange(self):
        self.asked.append("exchange")

    def exit_initialization(self):
        self.asked.append("exit")


class Trial:
    """A run with an output that feeds an input, and an unconnected input."""

    def __init__(self, events, sources, stubborn=False):
        self.sources, self.events, self.component = sources, Events(events), Component(stubborn)
        columns = {OUT: 0, FED: 1, FREE: 2}
        values = np.array([sources[0], sources[0], 7.0])
        self.row = SimpleNamespace(
            values=values,
            columns=columns,
            number=float,
            value=lambda port: values[columns[port]],
            places=lambda ws: np.array([[columns[w.target], columns[w.source]] for w in ws]).T,
        )
        wires = (Connection(OUT, FED),)
        self.gather = Gathering.along(self.row, wires)
        self.run = SimpleNamespace(
            row=self.row,
            overrides=Overrides(self.row, [self.gather], wires),
            experiment=EXPERIMENT,
            instances={"a": self.component},
            system=SimpleNamespace(parameters_of=lambda name: {"gain": 1.0, "other": 2.0}),
            made=0,
            time=0.0,
            happened=[],
            ahead=nullcontext,
            passing=None,
            refresh=lambda name: None,
        )
        self.due = 0

    def step(self):
        """Call the hook if it is due, make a step, and return its inputs and parameter."""
        run = self.run
        run.time = EXPERIMENT.time(run.made)
        if self.due <= run.made:
            self.due = self.events.act(run)
            assert self.due > run.made
        self.gather(self.row.values)
        seen = (*self.row.values[1:], self.component.gain)
        run.made += 1
        self.row.values[0] = self.sources[run.made]
        return seen

    def remember(self):
        """Save and restore the state, like a resumed run."""
        fresh = Events(self.events._events)
        fresh.restore(json.loads(json.dumps(self.events.state())))
        self.events, self.due = fresh, self.run.made


def seen(events, sources=None, resumed=()):
    trial = Trial(events, sources if sources is not None else np.arange(STEPS + 1.0))
    values = []
    for k in range(STEPS):
        if k in resumed:
            trial.remember()
        values.append(trial.step())
    return np.array(values), trial


def event(action, **how):
    return Event("something", action, "it", **how)


def override(value, target=FED):
    return Alter("override", ((target, value),))


def bias(value, target=FED):
    return Alter("bias", ((target, value),))


def test_it_acts_from_the_first_instant_that_its_time_is_not_after():
    values, trial = seen([event(override(-1.0), at=1.3, lasts=1.0)])
    expected = np.arange(STEPS + 0.0)
    # 1.3 s is within the third step of 0.5 s, and 1 s later two steps have passed.
    expected[3:5] = -1.0
    np.testing.assert_array_equal(values[:, 0], expected)
    assert [(event.time, event.label) for event in trial.run.happened] == [(1.5, "it"), (2.5, "")]


@pytest.mark.parametrize("k", range(STEPS))
def test_a_time_within_rounding_of_an_instant_is_that_instant(k):
    values, _ = seen([event(override(-1.0), at=0.1 * (5 * k))])
    assert list(values[:, 0] == -1.0).index(True) == k


def test_a_condition_must_become_true():
    sources = np.array([9.0, 9.0, 1.0, 9.0, 1.0, *[9.0] * STEPS])
    when = Condition(OUT, ">", 5.0)
    once, trial = seen([event(bias(0.5), when=when, lasts=0.5)], sources)
    assert list(np.flatnonzero(once[:, 0] == 9.5)) == [3]
    assert [event.time for event in trial.run.happened] == [1.5, 2.0]
    again, _ = seen([event(bias(0.5), when=when, lasts=0.5, repeat=True)], sources)
    assert list(np.flatnonzero(again[:, 0] == 9.5)) == [3, 5]


@pytest.mark.parametrize(
    ("sign", "holds"),
    [("<", operator.lt), ("<=", operator.le), (">", operator.gt), (">=", operator.ge)],
)
def test_comparisons_are_what_they_look_like(sign, holds):
    row = SimpleNamespace(value={OUT: 2.0}.get)
    for limit in (1.0, 2.0, 3.0):
        assert Condition(OUT, sign, limit).holds(row) == holds(2.0, limit)


def test_what_is_frozen_keeps_what_it_was_last():
    values, _ = seen([event(Freeze((FED, FREE)), at=2.0, lasts=1.0)])
    assert list(values[:8, 0]) == [0, 1, 2, 3, 3, 3, 6, 7]
    assert set(values[:, 1]) == {7.0}


def test_release_ends_all_changes_of_a_signal():
    events = [
        event(override(-1.0), at=1.0),
        event(bias(2.0), at=1.5),
        event(override(-2.0, FREE), at=1.5),
        event(Release((FED, FREE)), at=2.5),
    ]
    values, _ = seen(events)
    assert list(values[:7, 0]) == [0, 1, -1, 5, 6, 5, 6]
    assert list(values[:7, 1]) == [7, 7, 7, -2, -2, 7, 7]


def test_a_change_applies_to_a_value_that_is_set():
    events = [
        event(bias(0.5, FREE), at=1.0, lasts=2.0),
        event(Set((), ((FREE, 3.0),)), at=2.0, lasts=2.0),
    ]
    values, _ = seen(events)
    assert list(values[:10, 1]) == [7, 7, 7.5, 7.5, 3.5, 3.5, 3, 3, 7, 7]


def test_a_parameter_that_is_not_taken_ends_the_run():
    trial = Trial([event(Set(((GAIN, 3.0),), ()), at=0.0)], np.zeros(STEPS + 1), stubborn=True)
    with pytest.raises(ComponentFailed, match=r"a\.gain was set to 3\.0, but the FMU holds 1\.0"):
        trial.step()


def test_a_component_restarts_with_its_present_parameters():
    _, trial = seen([event(Set(((GAIN, 3.0),), ()), at=1.0), event(Reset(("a",)), at=2.0)])
    values = {"gain": 3.0, "other": 2.0}
    entered = ("enter", values, 2.0)
    assert trial.component.asked == ["reset", entered, "exchange", "exit", "exchange"]


def test_a_stop_ends_the_run():
    trial = Trial([event(Stop("enough"), at=0.5)], np.zeros(STEPS + 1))
    trial.step()
    with pytest.raises(Ended, match="enough"):
        trial.step()


def test_a_condition_that_chatters_is_listed_a_limited_number_of_times():
    chatter = Event("x", bias(1.0), "x", when=Condition(OUT, ">", 0.0), repeat=True)
    events, run = Events([chatter]), Trial([], np.zeros(STEPS + 1)).run
    run.experiment = Experiment(1e5, 0.5)
    for k in range(5000):
        run.made, run.row.values[0] = k, k % 2
        events.act(run)
    assert len(run.happened) == 1000
    assert run.happened[-1].text == "x; later occurrences are not listed"


def test_nothing_is_wanted_where_nothing_can_happen_any_more():
    _, trial = seen([event(override(-1.0), at=1.0), event(bias(1.0), at=99.0)])
    assert trial.due >= STEPS
    trial.run.made = STEPS
    assert trial.events.act(trial.run) == NEVER


# Any events

kinds = st.sampled_from(["override", "bias"])
moments = st.integers(0, STEPS + 2)
durations = st.none() | st.integers(1, STEPS)
happenings = st.lists(st.tuples(kinds, st.integers(-5, 5), moments, durations), max_size=6)


@given(happenings, st.sets(st.integers(0, STEPS - 1), max_size=3))
def test_of_several_the_latest_acts_and_then_the_one_before(wanted, resumed):
    """With or without a resumption in between."""
    h = EXPERIMENT.step
    events = [
        event(Alter(kind, ((FED, float(value)), (FREE, float(value)))), at=at * h,
              lasts=None if n is None else n * h)
        for kind, value, at, n in wanted
    ]  # fmt: skip
    values, _ = seen(events, resumed=resumed)
    for k in range(STEPS):
        acting = [
            (at, i)
            for i, (_, _, at, n) in enumerate(wanted)
            if at <= k and (n is None or k < at + n)
        ]
        for place, plain in ((0, float(k)), (1, 7.0)):
            expected = plain
            if acting:
                kind, value, *_ = wanted[max(acting)[1]]
                expected = value + plain * (kind == "bias")
            assert values[k, place] == expected


@given(st.lists(st.tuples(st.integers(2, 9), moments, durations), max_size=5))
def test_parameters_go_back_to_what_they_were(wanted):
    h = EXPERIMENT.step
    events = [
        event(Set(((GAIN, float(value)),), ()), at=at * h, lasts=None if n is None else n * h)
        for value, at, n in wanted
    ]
    values, _ = seen(events)
    for k in range(STEPS):
        acting = [
            (at, i) for i, (_, at, n) in enumerate(wanted) if at <= k and (n is None or k < at + n)
        ]
        assert values[k, 2] == (wanted[max(acting)[1]][0] if acting else 1.0)
