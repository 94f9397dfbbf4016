"""What a component defines, in one as small as can be: dx/dt = gain a, seen as b."""

from __future__ import annotations

from math import inf, nan
from typing import NamedTuple, TypedDict

import pytest
from pythonfmu.enums import Fmi2Status

from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, Port, Refusal, inputs, outputs, parameter
from fmus.slave import callbacks, component
from fmus.slave.component import Component

GAIN = parameter("gain", 1.0, "1", "Gain", 0.0, tunable=True)
UP = Port("up", "parameter", "fixed", "Boolean", "Which way", start=True)
PORTS = (
    *inputs("a", {"x": "m", "y": "m"}, "Rate"),
    *outputs("b", {"x": "m", "y": "m"}, "Place"),
    *outputs("c", {"x": "m"}, "Time of the last sample"),
    GAIN,
    UP,
    H_MAX,
)
A, B, C = [0, 1], [2, 3], [4]


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


@pytest.fixture
def slave():
    """Defined within the test that uses it, so that the definition is part of what is tested."""

    class Integrator(Component[Place, Inputs, Outputs, Chosen]):
        ports = PORTS
        parameter_set = ParameterSet(Chosen, gain=GAIN, up=UP)
        samples = 0

        def check(self, parameters: Chosen) -> None:
            if parameters.gain > 9.0:
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

    return Integrator(instance_name="under_test")


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
    said = "up is fixed and cannot be set after the initialisation"
    assert [entry.msg for entry in slave.log_queue] == [said]
    assert slave.get_boolean([6]) == [True]


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
    assert slave.get_real(A) == [0.0, 0.0]
    assert len(slave.log_queue) == 2


def test_what_equations_raise_is_named_and_logged_once_whatever_the_time(slave, monkeypatch):
    def broken(*arguments: object) -> None:
        raise ZeroDivisionError("of nothing")

    monkeypatch.setattr(initialised(slave), "advance", broken)
    for t in (1.0, 2.0):
        assert not slave.do_step(t, 0.1)
    [entry] = slave.log_queue
    assert entry.msg == "step refused at t = 1 s: ZeroDivisionError: of nothing"
    assert entry.status == Fmi2Status.discard


def test_the_last_message_says_that_it_is_the_last(slave, monkeypatch):
    monkeypatch.setattr(callbacks, "MOST_MESSAGES", 2)
    for reference in (97, 98, 99):
        slave.get_real([reference])
    first, last = (entry.msg for entry in slave.log_queue)
    assert first == "no Real has the value reference 97"
    assert last == "no Real has the value reference 98; what comes after this is not logged"


def test_a_refused_state_is_mended_by_a_good_one_alone(slave):
    saved = initialised(slave)._get_fmu_state()
    slave._set_fmu_state({})
    assert slave._get_fmu_state()["refused"].keys() == {"fmi2SetFMUstate"}
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
    assert [entry.msg for entry in slave.log_queue] == ["too much"]
    assert slave.get_real([5]) == [2.0]
    assert not slave.do_step(0.0, 0.5)
    slave.set_real([5], [3.0])
    slave.set_real(A, [1.0, 1.0])
    assert slave.do_step(0.0, 0.5)
    assert slave.get_real(B) == [1.5, 1.5]


def test_largest_number_of_internal_steps_is_allowed(slave, monkeypatch):
    monkeypatch.setattr(component, "MOST_INTERNAL_STEPS", 3)
    initialised(slave)
    assert slave.do_step(0.0, 0.06)
    assert not slave.do_step(0.0, 0.0601)
    assert "needs 4 internal steps; raise h_max" in slave.log_queue[0].msg


def test_a_reference_that_is_no_port_is_mended_by_a_state_alone(slave):
    initialised(slave)
    saved = slave._get_fmu_state()
    for call in (lambda: slave.get_real([99]), lambda: slave.set_real([99], [1.0])):
        call()
        assert slave._get_fmu_state()["refused"].keys() == {"value reference"}
        slave.set_real(A, [0.0, 0.0])
        assert not slave.do_step(0.0, 0.1)
        slave._set_fmu_state(saved)
        assert slave.do_step(0.0, 0.1)


def test_description_is_that_of_the_ports_and_knows_no_time_of_its_build(slave):
    root = slave.to_xml()
    assert "generationDateAndTime" not in root.attrib
    names = [variable.get("name") for variable in root.iter("ScalarVariable")]
    assert names == [*(port.name for port in PORTS), "fault"]


def test_refusals_come_back_in_the_order_in_which_they_were_made(slave):
    """A step that they block names them in that order."""
    initialised(slave).get_string([0])
    slave.setup_experiment(0.0)
    content = slave._fmu_state_to_bytes(slave._get_fmu_state())
    refused = slave._fmu_state_from_bytes(content)["refused"]
    assert [*refused] == ["value reference", "fmi2SetupExperiment"]


def test_fault_is_known_as_soon_as_it_is_asked_for(slave):
    slave.setup_experiment(0.0)
    slave.set_real([5], [10.0])
    slave.enter_initialization_mode()
    assert slave.get_boolean([8]) == [True]
    assert slave._get_fmu_state()["refused"] == {
        "initialisation": "initialisation refused: too much"
    }


def test_experiment_that_is_not_set_up_starts_at_zero(slave):
    slave.enter_initialization_mode()
    assert slave.get_real(C) == [0.0]


def test_call_out_of_order_blocks_by_its_name(slave):
    slave.terminate()
    assert slave._get_fmu_state()["refused"].keys() == {"fmi2Terminate"}


def test_fault_can_be_read_among_others(slave):
    assert initialised(slave).get_boolean([6, 8]) == [True, False]


def test_state_of_whole_numbers_is_bounded_as_one_of_floats(slave):
    saved = initialised(slave)._get_fmu_state()
    slave._set_fmu_state({**saved, "state": [[3, 4]], "outputs": [3, 4, 0.0]})
    assert slave._get_fmu_state()["state"] == ((3.0, 4.0),)
    slave._set_fmu_state({**saved, "state": [[10**200, 0]]})
    slave._set_fmu_state({**saved, "state": [[1e100, 0.0]]})
    assert slave._get_fmu_state()["state"] == ((1e100, 0.0),)
    assert [entry.msg for entry in slave.log_queue] == ["state refused: beyond 1e+100"]


def test_state_that_cannot_be_saved_says_why_when_it_is_set(slave, monkeypatch):
    def broken() -> None:
        raise Refusal("not now")

    monkeypatch.setattr(initialised(slave), "hidden_state", broken)
    slave._set_fmu_state(slave._get_fmu_state())
    assert [entry.msg for entry in slave.log_queue] == ["state refused: not now"]


@pytest.mark.parametrize(
    ("state", "b", "why"),
    [
        ((1.0, nan), 0.0, "the state is not finite, or beyond 1e+100"),
        ((-1.1e100, 0.0), 0.0, "the state is not finite, or beyond 1e+100"),
        ((0.0, 0.0), nan, "b.y = nan: must be finite"),
        ((0.0, 0.0), -inf, "b.y = -inf: must be finite"),
    ],
)
def test_state_and_outputs_are_checked_each_for_itself(slave, monkeypatch, state, b, why):
    outcome = Place(state), {"b": (0.0, b), "c": (0.0,)}
    monkeypatch.setattr(initialised(slave), "advance", lambda *arguments: outcome)
    assert not slave.do_step(0.0, 0.1)
    assert [entry.msg for entry in slave.log_queue] == [f"step refused at t = 0 s: {why}"]
    assert slave.get_real(B) == [0.0, 0.0]


def test_experiment_is_refused_by_name_until_a_good_one_comes(slave):
    slave.setup_experiment(nan)
    slave.setup_experiment(0.0, -1.0)
    assert slave._get_fmu_state()["refused"].keys() == {"fmi2SetupExperiment"}
    assert [entry.msg for entry in slave.log_queue] == [
        "experiment refused: start time nan: must be finite",
        "experiment refused: stop time -1.0: must not be before 0.0",
    ]
    slave.setup_experiment(2.0, 2.0)
    assert slave._get_fmu_state()["refused"] == {}
