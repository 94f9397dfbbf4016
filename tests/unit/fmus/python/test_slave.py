"""A slave of a component of one equation, dx/dt = gain a, with the output b."""

from __future__ import annotations

from math import inf, nan

import pytest
from pythonfmu.enums import Fmi2Status

from fmus.python import component
from fmus.python.slave import slave_of
from support import integrator
from support.instances import answers_of, messages_of
from support.own import imported

#: References of the ports.
A, B, C = [0, 1], [2, 3], [4]
GAIN, UP, MOST, H_MAX, FAULT = 5, 6, 7, 8, 9


@pytest.fixture
def slave():
    """A slave made within the test, so that its class is made there, too."""
    made = slave_of.__wrapped__("Integrator", integrator)(instance_name="under_test")
    made._has_loader = True
    return made


def initialised(slave, t=0.0):
    slave.setup_experiment(t)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def test_what_equations_raise_is_named_and_logged_once_whatever_the_time(slave, monkeypatch):
    def broken(*arguments: object) -> None:
        raise ZeroDivisionError("of nothing")

    monkeypatch.setattr(initialised(slave), "advance", broken)
    for t in (1.0, 2.0):
        assert not slave.do_step(t, 0.1)
    entry, *answers = slave.log_queue
    assert entry.msg == "step refused at t = 1 s: ZeroDivisionError: of nothing"
    assert entry.status == Fmi2Status.discard
    assert [(answer.msg, answer.status, answer.category) for answer in answers] == [
        ("", Fmi2Status.discard, component.ANSWER)
    ] * 2


def test_the_last_message_says_that_it_is_the_last(slave, monkeypatch):
    monkeypatch.setattr(component, "MOST_MESSAGES", 2)
    for reference in (97, 98, 99):
        slave.get_real([reference])
    first, last = messages_of(slave)
    assert answers_of(slave) == [Fmi2Status.error] * 3
    assert first == "no Real has the value reference 97"
    assert last == "no Real has the value reference 98; further messages are not logged"


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
    assert slave.get_real(B) == pytest.approx([1.5, 1.5])


def test_parameters_that_only_fit_together_are_taken_together(slave):
    initialised(slave)
    for reference, value in ((GAIN, 20.0), (MOST, 0.5)):
        slave.set_real([reference], [value])
    assert answers_of(slave) == [Fmi2Status.discard] * 2
    for references, values in (([GAIN, MOST], [20.0, 25.0]), ([MOST, GAIN], [0.5, 0.25])):
        slave.set_real(references, values)
        assert slave.get_real(references) == values
        assert slave.parameters == (slave.get_real([GAIN])[0], True, slave.get_real([MOST])[0])
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


def test_without_a_loader_a_step_tells_the_first_refusal(slave):
    slave._has_loader = False
    initialised(slave).setup_experiment(0.0)
    slave.set_real([0], [nan])
    slave.get_string([0])
    assert not slave.do_step(0.0, 0.1)
    assert slave._failure == "fmi2SetupExperiment is not allowed when stepping"


def test_state_of_whole_numbers_is_bounded_as_one_of_floats(slave):
    saved = initialised(slave)._get_fmu_state()
    slave._set_fmu_state({**saved, "state": [[3, 4]]})
    assert slave._get_fmu_state()["state"] == ((3.0, 4.0),)
    slave._set_fmu_state({**saved, "state": [[10**200, 0]]})
    slave._set_fmu_state({**saved, "state": [[1e100, 0.0]]})
    assert slave._get_fmu_state()["state"] == ((1e100, 0.0),)
    assert messages_of(slave) == ["state refused: it exceeds 1e+100"]


@pytest.mark.parametrize("state", [(1.0, nan), (-1.1e100, 0.0)])
def test_state_that_is_out_of_bounds_refuses_the_step(slave, state):
    initialised(slave)
    slave._store.state = integrator.State(state)
    assert not slave.do_step(0.0, 0.1)
    why = "the state is not finite, or exceeds 1e+100"
    assert messages_of(slave) == [f"step refused at t = 0 s: {why}"]
    assert slave.get_real(B) == [0.0, 0.0]


@pytest.mark.parametrize("b", [nan, -inf])
def test_outputs_that_are_not_finite_refuse_the_step(monkeypatch, tmp_path, b):
    """Outputs without feedthrough belong to the end of the step and are computed in it."""
    own = imported(monkeypatch, tmp_path, ("Outputs(state.x)", "Outputs(state.x * BAD)"),
                   ("class Parameters", "BAD = 1.0\n\n\nclass Parameters"))  # fmt: skip
    slave = initialised(slave_of("Lag", own)(instance_name="under_test"))
    before = slave._get_fmu_state()
    monkeypatch.setattr(own, "BAD", b)
    assert not slave.do_step(0.0, 0.1)
    assert messages_of(slave) == [f"step refused at t = 0 s: x = {b}: must be finite"]
    assert slave._get_fmu_state() == {**before, "fault": True}


#: A lag with an input only in its output, which refuses some of its values.
SEEN = (
    ("def outputs(state: State)", "def outputs(state: State, inputs: Inputs)"),
    ("return Outputs(state.x)", "if inputs.u > 8.0:\n        raise Refusal('too far')\n"
     "    return Outputs(state.x + inputs.u)"),
)  # fmt: skip


def seen(monkeypatch, tmp_path, *changes):
    slave = slave_of("Lag", imported(monkeypatch, tmp_path, *SEEN, *changes))(instance_name="lag")
    slave._has_loader = True
    return initialised(slave)


def test_state_is_asked_whether_a_run_can_have_led_to_it(slave):
    saved = initialised(slave)._get_fmu_state()
    slave._set_fmu_state({**saved, "state": ((123.0, 0.0),)})
    assert messages_of(slave) == ["state refused: it is not reached"]
    assert slave._get_fmu_state() == saved


#: A lag whose output has noise, which the input can make too large.
NOISE = (
    (
        "def outputs(state: State) -> Outputs:",
        "def seed(parameters: Parameters) -> int:\n    return 3\n\n"
        "def measured(x: float, n: tuple[float, float]) -> float:\n"
        "    if abs(x) > 50.0:\n        raise Refusal('lost')\n"
        "    return x + 0.0 * n[0] + n[1]\n\n"
        "def outputs(state: State) -> Outputs:",
    ),
)


def noisy(monkeypatch, tmp_path):
    return slave_of("Lag", imported(monkeypatch, tmp_path, *NOISE))


@pytest.mark.parametrize("draws", [[0.0, 9.1], [0.0, nan], [0.0], [0.0, "1"], None])
def test_noise_that_cannot_be_drawn_is_refused(monkeypatch, tmp_path, draws):
    slave = initialised(noisy(monkeypatch, tmp_path)(instance_name="lag"))
    saved = slave._get_fmu_state()
    slave._set_fmu_state({**saved, "draws": draws})
    [message] = messages_of(slave)
    assert message.startswith("state refused: ")
    assert slave._get_fmu_state() == saved
