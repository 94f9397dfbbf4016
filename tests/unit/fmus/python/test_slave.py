"""A slave of a component as small as can be, dx/dt = gain a, seen as b; and how slaves are made."""

from __future__ import annotations

from math import inf, nan
from types import ModuleType
from typing import NamedTuple, TypedDict

import pytest
from pythonfmu.enums import Fmi2Status

from fmus.motion_planner import ports as of_a_planner
from fmus.observer_controller import behaviour, ports
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, Port, Refusal, inputs, outputs, parameter
from fmus.python import callbacks, component
from fmus.python.component import Component
from fmus.python.slave import slave_of
from support.instances import answers_of, messages_of

GAIN = parameter("gain", 1.0, "1", "Gain", 0.0, tunable=True)
MOST = parameter("most", 9.0, "1", "Largest gain", 0.0, tunable=True)
UP = Port("up", "parameter", "fixed", "Boolean", "Which way", start=True)
PORTS = (
    *inputs("a", {"x": "m", "y": "m"}, "Rate"),
    *outputs("b", {"x": "m", "y": "m"}, "Place"),
    *outputs("c", {"x": "m"}, "Time of the last sample"),
    GAIN,
    UP,
    H_MAX,
    MOST,
)
A, B, C = [0, 1], [2, 3], [4]
FAULT = 9


class Place(NamedTuple):
    x: tuple[float, float]


class Inputs(NamedTuple):
    a: tuple[float, float]


class Outputs(TypedDict):
    b: tuple[float, float]
    c: tuple[float]


class Chosen(NamedTuple):
    gain: float
    up: bool
    most: float


@pytest.fixture
def slave():
    """Defined within the test that uses it, so that the definition is part of what is tested."""

    class Integrator(Component[Place, Inputs, Outputs, Chosen]):
        ports = PORTS
        parameter_set = ParameterSet(Chosen, gain=GAIN, up=UP, most=MOST)
        samples = 0

        def check(self, parameters: Chosen) -> None:
            if parameters.gain > parameters.most:
                raise Refusal("too much")

        def begin(self, inputs: Inputs, t: float) -> tuple[Place, Outputs]:
            return Place(inputs.a), {"b": inputs.a, "c": (t,)}

        def advance(
            self, state: Place, inputs: Inputs, t: float, h: float, n: int
        ) -> tuple[Place, Outputs]:
            rate = self.parameters.gain if self.parameters.up else -self.parameters.gain
            x, y = (x + n * h * rate * a for x, a in zip(state.x, inputs.a, strict=True))
            return Place((x, y)), {"b": (x, y), "c": (t,)}

        def sample(self, values: list[float]) -> list[float]:
            self.samples += 1
            return [inf] if self.samples == 7 else []

    made = Integrator(instance_name="under_test")
    made._has_loader = True
    return made


def initialised(slave, t=0.0):
    slave.setup_experiment(t)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def test_inputs_and_parameters_reach_the_equations_and_outputs_the_host(slave):
    slave.set_real(A, [1.0, -2.0])
    initialised(slave, 3.0)
    assert slave.get_real(B + C) == [1.0, -2.0, 3.0]
    slave.set_real([5], [4.0])
    assert slave.do_step(3.0, 0.5)
    assert slave.get_real(B + C) == [3.0, -6.0, 3.0]


def test_truth_values_reach_the_equations(slave):
    slave.set_boolean([6], [False])
    assert slave.get_boolean([6]) == [False]
    initialised(slave)
    slave.set_real(A, [2.0, 4.0])
    assert slave.do_step(0.0, 0.5)
    assert slave.get_real(B) == [-1.0, -2.0]


def test_fixed_parameter_stays_what_it_was_at_the_start(slave):
    initialised(slave).set_boolean([6], [False])
    said = "up is fixed and cannot change after initialisation"
    assert messages_of(slave) == [said]
    assert answers_of(slave) == [Fmi2Status.error]
    assert slave.get_boolean([6]) == [True]


def test_fixed_parameter_may_be_set_to_what_it_is(slave):
    initialised(slave).set_boolean([6], [True])
    slave.set_real([7, 5], [H_MAX.start, 3.0])
    assert slave.log_queue == []
    assert slave.get_real([5]) == [3.0], "the others of the call are taken"


def test_outputs_at_the_start_follow_every_value_that_is_set_until_then(slave):
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    for value in (5.0, 6.0):
        slave.set_real([0], [value])
        assert slave.get_real([2]) == [value]
        assert slave._get_fmu_state()["state"] == ((value, 0.0),)
        slave.set_real(A, [-value, 1.0])
        assert slave.get_real(B) == [-value, 1.0]
        slave.set_real([1], [0.0])
    slave.exit_initialization_mode()
    slave.set_real([0], [7.0])
    assert slave.get_real(B) == [-6.0, 0.0]


def test_all_inputs_in_one_call_are_refused_after_the_end_as_one_is(slave):
    initialised(slave).terminate()
    slave.set_real(A, [1.0, 2.0])
    slave.set_real(A[:1], [1.0])
    assert slave.get_real(A) == [0.0, 0.0]
    assert messages_of(slave) == ["fmi2SetReal is not allowed when terminated"]
    assert answers_of(slave) == [Fmi2Status.error] * 2


def test_what_equations_raise_is_named_and_logged_once_whatever_the_time(slave, monkeypatch):
    def broken(*arguments: object) -> None:
        raise ZeroDivisionError("of nothing")

    monkeypatch.setattr(initialised(slave), "advance", broken)
    for t in (1.0, 2.0):
        assert not slave.do_step(t, 0.1)
    entry, *answers = slave.log_queue
    assert entry.msg == "step refused at t = 1 s: ZeroDivisionError: of nothing"
    assert entry.status == Fmi2Status.discard
    assert [(it.msg, it.status, it.category) for it in answers] == [
        ("", Fmi2Status.discard, callbacks.ANSWER)
    ] * 2


def test_the_last_message_says_that_it_is_the_last(slave, monkeypatch):
    monkeypatch.setattr(callbacks, "MOST_MESSAGES", 2)
    for reference in (97, 98, 99):
        slave.get_real([reference])
    first, last = messages_of(slave)
    assert answers_of(slave) == [Fmi2Status.error] * 3
    assert first == "no Real has the value reference 97"
    assert last == "no Real has the value reference 98; further messages are not logged"


def test_without_a_loader_only_a_state_leads_out_of_a_refused_one(slave):
    slave._has_loader = False
    saved = initialised(slave)._get_fmu_state()
    slave._set_fmu_state({})
    assert slave._get_fmu_state() == saved
    slave.set_real(A, [0.0, 0.0])
    assert not slave.do_step(0.0, 0.1)
    slave._set_fmu_state(saved)
    assert slave.do_step(0.0, 0.1)


def test_outputs_are_sampled_once_at_the_start_and_once_a_step(slave):
    initialised(slave)
    for k in range(1, 6):
        assert slave.samples == k
        assert slave.do_step(k, 0.1)
    assert not slave.do_step(6.0, 0.1)
    assert slave.samples == 7
    assert slave.log_queue[0].msg.endswith(": a sampled output is not finite")


def test_parameters_that_do_not_fit_are_refused_before_a_step_and_leave_the_others(slave):
    initialised(slave)
    slave.set_real([5], [2.0])
    slave.set_real([5], [10.0])
    assert messages_of(slave) == ["too much"]
    assert answers_of(slave) == [Fmi2Status.discard]
    assert slave.get_real([5]) == [2.0]
    assert slave.parameters.gain == 2.0
    slave.set_real([0, 5], [1.0, 10.0])
    assert slave.get_real([0]) == [0.0], "of a call all is taken, or nothing"
    slave.set_real([5], [3.0])
    slave.set_real(A, [1.0, 1.0])
    assert slave.do_step(0.0, 0.5)
    assert slave.get_real(B) == [1.5, 1.5]


def test_parameters_that_only_fit_together_are_taken_together(slave):
    initialised(slave)
    for reference, value in ((5, 20.0), (8, 0.5)):
        slave.set_real([reference], [value])
    assert answers_of(slave) == [Fmi2Status.discard] * 2
    for references, values in (([5, 8], [20.0, 25.0]), ([8, 5], [0.5, 0.25])):
        slave.set_real(references, values)
        assert slave.get_real(references) == values
        assert slave.parameters == (slave.get_real([5])[0], True, slave.get_real([8])[0])
    assert len(answers_of(slave)) == 2
    slave.set_real(A, [1.0, 0.0])
    assert slave.do_step(0.0, 0.02)
    assert slave.get_real(B) == [0.02 * 0.25, 0.0]


def test_largest_number_of_internal_steps_is_allowed(slave, monkeypatch):
    monkeypatch.setattr(component, "MOST_INTERNAL_STEPS", 3)
    initialised(slave)
    assert slave.do_step(0.0, 0.06)
    assert not slave.do_step(0.0, 0.0601)
    assert "needs more than 3 internal steps" in slave.log_queue[0].msg


def test_one_bad_value_among_good_ones_leaves_all_as_they_were(slave):
    initialised(slave)
    before = slave._get_fmu_state()
    for references, values, status in (
        ([0, 1], [5.0, nan], Fmi2Status.discard),
        ([0, 5, 2], [5.0, 2.0, 1.0], Fmi2Status.discard),
        ([0, 5, 99], [5.0, 2.0, 1.0], Fmi2Status.error),
        ([99, 1], [5.0, nan], Fmi2Status.error),
        ([1, 99], [nan, 5.0], Fmi2Status.error),
    ):
        slave.log_queue.clear()
        slave.set_real(references, values)
        assert answers_of(slave) == [status]
        assert {**slave._get_fmu_state(), "fault": False} == before
    assert slave.do_step(0.0, 0.1)


def test_values_that_the_host_brings_are_its_own(slave):
    """It may reuse its list for the next call."""
    values = [1.0, 2.0]
    initialised(slave).set_real(A[:1], values[:1])
    kept = slave._store.inputs
    slave.set_real(A[1:], [2.0])
    assert kept == [1.0, 0.0]
    assert slave.get_real(A) == [1.0, 2.0]


def test_description_is_that_of_the_ports_and_knows_no_time_of_its_build(slave):
    root = slave.to_xml()
    assert "generationDateAndTime" not in root.attrib
    names = [variable.get("name") for variable in root.iter("ScalarVariable")]
    assert names == [*(port.name for port in PORTS), "fault"]


def test_without_a_loader_a_step_tells_the_first_refusal(slave):
    slave._has_loader = False
    initialised(slave).setup_experiment(0.0)
    slave.set_real([0], [nan])
    slave.get_string([0])
    assert not slave.do_step(0.0, 0.1)
    assert slave._untold == "fmi2SetupExperiment is not allowed when stepping"


def test_values_that_give_no_start_are_refused_by_what_needs_one(slave):
    """Others may be on their way: what only reads them on has no consequence."""
    slave.setup_experiment(0.0)
    slave.set_real([5], [10.0])
    slave.enter_initialization_mode()
    assert slave.log_queue == []
    assert slave.get_real([5]) == [10.0]
    assert slave.get_boolean([FAULT]) == [False]
    assert slave.log_queue == []
    assert slave.get_real([5, 2]) == [10.0, 0.0]
    slave.exit_initialization_mode()
    assert messages_of(slave) == ["initialisation refused: too much"]
    assert answers_of(slave) == [Fmi2Status.error] * 2
    assert slave.get_boolean([FAULT]) == [False]
    assert slave._get_fmu_state()["mode"] == "initialising"
    slave.set_real([5], [9.0])
    slave.exit_initialization_mode()
    assert slave.do_step(0.0, 0.1)


def test_experiment_that_is_not_set_up_starts_at_zero(slave):
    slave.enter_initialization_mode()
    assert slave.get_real(C) == [0.0]


def test_fault_can_be_read_among_others(slave):
    assert initialised(slave).get_boolean([6, FAULT]) == [True, False]
    assert slave.get_real([FAULT, 6]) == [0.0, 1.0], "and as a number"


def test_state_of_whole_numbers_is_bounded_as_one_of_floats(slave):
    saved = initialised(slave)._get_fmu_state()
    slave._set_fmu_state({**saved, "state": [[3, 4]], "outputs": [3, 4, 0.0]})
    assert slave._get_fmu_state()["state"] == ((3.0, 4.0),)
    slave._set_fmu_state({**saved, "state": [[10**200, 0]]})
    slave._set_fmu_state({**saved, "state": [[1e100, 0.0]]})
    assert slave._get_fmu_state()["state"] == ((1e100, 0.0),)
    assert messages_of(slave) == ["state refused: it exceeds 1e+100"]


def test_state_that_cannot_be_saved_says_why_when_it_is_set(slave, monkeypatch):
    def broken() -> None:
        raise Refusal("not now")

    monkeypatch.setattr(initialised(slave), "hidden_state", broken)
    slave._set_fmu_state(slave._get_fmu_state())
    assert messages_of(slave) == ["state refused: not now"]


@pytest.mark.parametrize(
    ("state", "b", "why"),
    [
        ((1.0, nan), 0.0, "the state is not finite, or exceeds 1e+100"),
        ((-1.1e100, 0.0), 0.0, "the state is not finite, or exceeds 1e+100"),
        ((0.0, 0.0), nan, "b.y = nan: must be finite"),
        ((0.0, 0.0), -inf, "b.y = -inf: must be finite"),
    ],
)
def test_state_and_outputs_are_checked_each_for_itself(slave, monkeypatch, state, b, why):
    outcome = Place(state), {"b": (0.0, b), "c": (0.0,)}
    monkeypatch.setattr(initialised(slave), "advance", lambda *arguments: outcome)
    assert not slave.do_step(0.0, 0.1)
    assert messages_of(slave) == [f"step refused at t = 0 s: {why}"]
    assert slave.get_real(B) == [0.0, 0.0]


@pytest.mark.parametrize("start", [nan, inf, -inf])
def test_experiment_without_a_start_leaves_the_one_before(slave, start):
    slave.setup_experiment(2.0)
    slave.setup_experiment(start)
    assert messages_of(slave) == [f"start time {start}: must be finite"]
    assert answers_of(slave) == [Fmi2Status.error]
    slave.enter_initialization_mode()
    assert slave.get_real(C) == [2.0]


def test_instances_share_one_class_that_is_named_like_the_component():
    made = slave_of("ObserverController", ports, behaviour)
    assert slave_of("ObserverController", ports, behaviour) is made
    assert (made.__module__, made.__name__) == ("fmus.observer_controller", "ObserverController")


def test_ports_of_another_component_are_refused():
    with pytest.raises(TypeError, match="has the groups"):
        slave_of("Mixed", of_a_planner, behaviour)


def test_parameter_without_a_meaning_is_refused():
    more = ModuleType("more")
    vars(more).update(vars(ports))
    more.PORTS = (*ports.PORTS, next(p for p in of_a_planner.PORTS if p.name == "m11"))
    with pytest.raises(TypeError, match="Odd: not every parameter has a meaning, or a port"):
        slave_of("Odd", more, behaviour)
