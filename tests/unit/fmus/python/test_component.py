"""Each component as a Python class: values, refusals and steps."""

from __future__ import annotations

import json
from math import inf, isfinite, nan, radians
from typing import Any

import pytest
from pythonfmu.enums import Fmi2Status

from fmus.ports.port import H_MAX
from fmus.python.loading import ANSWER
from support.instances import ClassInstance, answers_of, component, messages_of
from support.settings import NAMES, WITH_INPUTS, ports_of

WITH_STEP_LIMIT = [name for name in NAMES if H_MAX in {port.name for port in ports_of(name)}]


@pytest.fixture(params=NAMES)
def driver(request: pytest.FixtureRequest) -> ClassInstance:
    return ClassInstance(request.param)


@pytest.fixture(params=WITH_INPUTS)
def driven(request: pytest.FixtureRequest) -> ClassInstance:
    return ClassInstance(request.param)


def first_input(driver: ClassInstance) -> str:
    return driver.ports[0].name


def test_nothing_is_refused_in_a_normal_run(driver):
    for k in range(20):
        driver.excite(k)
        assert driver.step()
    assert driver.get("fault") is False
    assert driver.messages() == driver.answers() == []


def test_parameters_report_their_declared_start_values(driver):
    for port in driver.ports:
        if port.causality == "parameter":
            assert driver.get(port.name) == port.start


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_bad_input_is_discarded_and_the_next_step_taken_with_the_value_before(driven, bad):
    calm = ClassInstance(driven.component.__name__)
    for driver in (driven, calm):
        driver.excite(1)
        driver.step()
    before, name = driven.outputs(), first_input(driven)
    value_before = driven.get(name)
    driven.slave.set_real([0], [bad])
    assert driven.answers() == [Fmi2Status.discard]
    assert name in driven.messages()[0]
    assert driven.get("fault") is True
    assert driven.get(name) == value_before
    assert driven.outputs() == before
    assert driven.step() and calm.step()
    assert driven.outputs() == calm.outputs()
    assert driven.get("fault") is True, "a fault stays until the component is reset"


@pytest.mark.parametrize("bad", [nan, inf])
def test_bad_input_among_good_ones_in_one_call_is_found(driven, bad):
    references = driven.references("input")
    before = driven.slave.get_real(references)
    values = [0.5] * len(references)
    values[-1] = bad
    driven.slave.set_real(references, values)
    assert driven.answers() == [Fmi2Status.discard]
    assert driven.slave.get_real(references) == before


def test_infinities_that_cancel_are_found():
    driver = ClassInstance("AuvPlant")
    references = driver.references("input")
    driver.slave.set_real(references, [inf, -inf] + [0.0] * (len(references) - 2))
    assert driver.answers() == [Fmi2Status.discard]


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("AuvPlant", "m11", 0.0),
        ("AuvPlant", "d66", -1.0),
        ("AuvPlant", "noise__std", nan),
        ("AuvPlant", "h_max", 0.0),
        ("MotionPlanner", "m55", -22.5),
        ("MotionPlanner", "tau_d__u", inf),
        ("ObserverController", "eps_t", 0.0),
        ("AuvPlant", "actuator__T__u", -0.1),
        ("AuvPlant", "current__x", nan),
        ("ObserverController", "saturation", 4),
        ("ObserverController", "observer", -1),
        ("ObserverController", "k_d", -50.0),
        ("DisturbanceGenerator", "omega_d", nan),
        ("PdController", "sigma", -1.0),
    ],
)
def test_wrong_parameter_is_an_error_before_the_run(name, parameter, value):
    """There are hosts that ignore fmi2Discard: they would run with the value before."""
    driver = ClassInstance(name, **{parameter: value})
    dotted = parameter.replace("__", ".")
    [port] = [port for port in driver.ports if port.name == dotted]
    assert driver.answers() == [Fmi2Status.error]
    assert driver.get("fault") is True
    assert driver.get(dotted) == port.start
    assert dotted in driver.messages()[0]


@pytest.mark.parametrize("initialising", [False, True])
def test_wrong_input_is_discarded_before_the_run(driven, initialising):
    slave = driven.component(instance_name="under_test")
    slave._has_loader = True
    if initialising:
        slave.enter_initialization_mode()
    slave.set_real([0, 0], [0.5, nan])
    assert answers_of(slave) == [Fmi2Status.discard]
    assert slave.get_real([0]) == [0.0]
    parameter = next(r for r, p in enumerate(slave.ports) if p.causality == "parameter")
    slave.set_real([0, parameter], [nan, slave.ports[parameter].start])
    assert answers_of(slave)[1:] == [Fmi2Status.error], "a parameter has not been taken with it"


def test_without_a_loader_no_step_is_made_with_another_value():
    """The host has been answered fmi2OK, and shall not find out by its results."""
    driver = ClassInstance("AuvPlant", plain=True, m11=0.0)
    assert driver.answers() == []
    for _ in range(2):
        assert not driver.step()
    driver.set(m11=30.0)
    assert not driver.step(), "a good value is no answer"


def test_outputs_and_fixed_parameters_cannot_be_set_during_the_run(driver):
    before = driver.outputs()
    output = next(port.name for port in driver.ports if port.causality == "output")
    driver.set(**{output.replace(".", "__"): 9.0})
    assert driver.outputs() == before
    refusals = 1
    for port in driver.ports:
        if port.causality == "parameter" and port.variability == "fixed" and port.type == "Real":
            driver.set(**{port.name.replace(".", "__"): port.start + 1.0})
            refusals += 1
            assert driver.get(port.name) == port.start
    assert driver.answers() == [Fmi2Status.error] * refusals
    assert driver.get("fault") is False


def test_integers_and_truth_values_can_be_read_as_numbers(driver):
    """There are hosts that read all outputs with fmi2GetReal."""
    for reference, port in enumerate(driver.ports):
        [number] = driver.slave.get_real([reference])
        assert type(number) is float
        assert number == driver.get(port.name)
    driver.slave.do_step(0.0, -1.0)
    fault = [port.name for port in driver.ports].index("fault")
    assert driver.slave.get_real([0, fault])[1] == 1.0
    assert driver.answers() == [Fmi2Status.discard]


def test_a_tunable_parameter_acts_from_the_next_step():
    driver = ClassInstance("DisturbanceGenerator", A_d=0.0)
    driver.set(nu__u=1.0)
    driver.step()
    assert driver.get("tau_w.u") == 0.5
    driver.set(A_f=0.75)
    driver.step()
    assert driver.get("tau_w.u") == 0.75
    assert driver.get("fault") is False


def output_of(slave) -> int:
    return slave._store.output_references[0]


def set_a_fixed_parameter(slave) -> None:
    reference, port = next(
        (reference, port)
        for reference, port in enumerate(slave.ports)
        if (port.variability, port.type) == ("fixed", "Real")
    )
    slave.set_real([reference], [port.start + 1.0])


#: Calls that get what cannot be given.
REFUSED_GETS = {
    "unknown reference": lambda slave: slave.get_real([10_000]),
    "negative reference": lambda slave: slave.get_real([-1]),
    "wrong type": lambda slave: slave.get_boolean([0]),
}

#: Calls that change nothing, and the status that each is answered with.
REFUSED_CALLS = {
    "unknown reference": (lambda slave: slave.set_real([10_000], [1.0]), Fmi2Status.error),
    "wrong type": (lambda slave: slave.set_string([0], ["one"]), Fmi2Status.error),
    "output": (lambda slave: slave.set_real([output_of(slave)], [1.0]), Fmi2Status.error),
    "fixed parameter": (set_a_fixed_parameter, Fmi2Status.error),
    "empty state": (lambda slave: slave._set_fmu_state({}), Fmi2Status.error),
    "truncated state": (
        lambda slave: slave._set_fmu_state(
            slave._fmu_state_from_bytes(slave._fmu_state_to_bytes(slave._get_fmu_state())[:-9])
        ),
        Fmi2Status.error,
    ),
    "experiment set up again": (lambda slave: slave.setup_experiment(0.0), Fmi2Status.error),
    "initialisation entered again": (
        lambda slave: slave.enter_initialization_mode(), Fmi2Status.error,
    ),
    "initialisation left again": (
        lambda slave: slave.exit_initialization_mode(), Fmi2Status.error,
    ),
}  # fmt: skip


def stepped(name: str, call: str = "", **arguments: bool) -> ClassInstance:
    """An instance in the middle of a run, in which a call can be refused."""
    if call == "fixed parameter" and not any(p.variability == "fixed" for p in ports_of(name)):
        pytest.skip("all of its parameters are tunable")
    driver = ClassInstance(name, **arguments)
    driver.excite(1)
    driver.step()
    return driver


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("call", REFUSED_CALLS)
def test_refused_call_is_answered_each_time_and_changes_nothing(name, call):
    driver, calm = stepped(name, call), stepped(name)
    refused, status = REFUSED_CALLS[call]
    before = driver.slave._get_fmu_state()
    for _ in range(3):
        refused(driver.slave)
    assert driver.answers() == [status] * 3
    assert len(driver.messages()) == 1, "what was said is not repeated, what is answered is"
    raised = status == Fmi2Status.discard
    assert driver.slave._get_fmu_state() == {**before, "fault": raised}
    assert driver.step() and calm.step()
    assert driver.outputs() == calm.outputs()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("call", REFUSED_CALLS)
def test_without_a_loader_no_step_is_taken_until_a_state_is_restored(name, call):
    driver = stepped(name, call, plain=True)
    before, saved = driver.outputs(), driver.slave._get_fmu_state()
    REFUSED_CALLS[call][0](driver.slave)
    [why] = driver.messages()
    for _ in range(2):
        assert not driver.step()
    assert driver.messages() == [why], "what was said is not said again"
    assert driver.answers() == []
    assert driver.get("fault") is True
    assert driver.outputs() == before
    driver.slave._set_fmu_state(saved)
    assert driver.get("fault") is False
    assert driver.step()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("call", REFUSED_GETS)
def test_refused_get_has_no_consequence(name, plain, call):
    driver = stepped(name, plain=plain)
    before = driver.slave._get_fmu_state()
    for _ in range(2):
        REFUSED_GETS[call](driver.slave)
    assert driver.answers() == ([] if plain else [Fmi2Status.error] * 2)
    assert len(driver.messages()) == 1
    assert driver.slave._get_fmu_state() == before
    assert driver.step()


@pytest.mark.parametrize("plain", [False, True])
def test_discarded_step_has_no_consequence_but_the_fault(driver, plain):
    driver.slave._has_loader = not plain
    for _ in range(2):
        assert not driver.slave.do_step(0.0, -1.0)
    assert driver.answers() == ([] if plain else [Fmi2Status.discard] * 2)
    assert len(driver.messages()) == 1
    assert driver.get("fault") is True
    assert driver.step()


@pytest.mark.parametrize(
    ("libraries", "plain"),
    [
        (["binaries/linux64/X.so", "binaries/linux64/X_pythonfmu.so"], False),
        (["binaries/linux64/X.so"], True),
        (["binaries/win64/X_pythonfmu.so"], True),
        ([], True),
    ],
)
def test_library_beside_the_loader_tells_a_slave_of_it(tmp_path, libraries, plain):
    for library in libraries:
        path = tmp_path / library
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    resources = tmp_path / "resources"
    resources.mkdir()
    slave = component("PdController")(instance_name="under_test", resources=str(resources))
    slave.set_real([0], [nan])
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    assert len(messages_of(slave)) == 1
    assert answers_of(slave) == ([] if plain else [Fmi2Status.discard])
    assert slave.do_step(0.0, 0.02) is not plain


def test_reference_beyond_two_to_the_31_is_named_as_the_host_knows_it(driver):
    """PythonFMU hands references over as signed numbers."""
    assert driver.slave.get_real([10_000, -1]) == [0.0, 0.0]
    assert "4294967295" in driver.messages()[1]


@pytest.mark.parametrize("stop", [nan, -1.0, -inf])
def test_stop_time_that_is_not_after_the_start_is_none(driver, stop):
    slave = driver.component(instance_name="under_test")
    slave.setup_experiment(0.0, stop)
    assert slave.log_queue == []


def test_initialisation_cannot_be_left_before_it_was_entered():
    slave = component("AuvPlant")(instance_name="under_test")
    slave.exit_initialization_mode()
    assert messages_of(slave) == ["fmi2ExitInitializationMode is not allowed when instantiated"]
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    assert not slave.do_step(0.0, 0.02), "there is no loader"


def test_after_the_end_nothing_is_set_or_stepped_and_everything_can_be_read(driven):
    driven.excite(1)
    driven.step()
    before = driven.outputs()
    driven.slave.terminate()
    assert not driven.step()
    driven.slave.set_real([0], [7.0])
    assert driven.messages() == [
        "fmi2DoStep is not allowed when terminated",
        "fmi2SetReal is not allowed when terminated",
    ]
    assert driven.answers() == [Fmi2Status.error] * 2
    assert driven.get("fault") is False
    assert driven.get(first_input(driven)) != 7.0
    assert driven.outputs() == before


@pytest.mark.parametrize("calls", [0, 1, 2, 3])
def test_run_can_be_ended_in_any_mode_and_again(driver, calls):
    slave = driver.component(instance_name="under_test")
    begin = (lambda: slave.setup_experiment(0.0), slave.enter_initialization_mode,
             slave.exit_initialization_mode)  # fmt: skip
    for call in begin[:calls]:
        call()
    slave.terminate()
    slave.terminate()
    assert slave.log_queue == []
    assert slave._get_fmu_state()["mode"] == "terminated"


@pytest.mark.parametrize(
    ("name", "start", "sample"),
    [
        ("PdController", {}, {"y__x": 1e155}),
        ("ObserverController", {}, {"dy_d__x": 1e150}),
        ("AuvPlant", {}, {"tau_w__p": 1e300}),
        ("AuvPlant", {}, {"tau_w__p": -1e300}),
        ("AuvPlant", {"tau_max__u": 1e300}, {"tau__u": 1e300}),
    ],
)
def test_one_wild_sample_is_refused_and_the_run_goes_on_after_it(name, start, sample):
    driver, calm = ClassInstance(name, **start), ClassInstance(name, **start)
    driver.set(**sample)
    assert not driver.step()
    assert driver.answers() == [Fmi2Status.discard]
    driver.set(**dict.fromkeys(sample, 0.0))
    for k in range(3):
        for other in (driver, calm):
            other.excite(k)
            assert other.step()
    assert driver.outputs() == calm.outputs()


def test_initial_values_without_a_next_step_are_refused():
    driver = ClassInstance("AuvPlant", nu0__p=1e160)
    assert "initialisation refused" in driver.messages()[0]
    assert driver.answers() == [Fmi2Status.error]
    assert driver.get("fault") is False
    assert driver.slave._get_fmu_state()["mode"] == "initialising"
    assert driver.outputs() == [0.0] * len(driver.outputs())
    driver.set(nu0__p=0.0)
    driver.slave.exit_initialization_mode()
    assert driver.step()


def test_outputs_that_are_only_too_large_to_be_added_up_are_taken():
    largest = 1.7e308
    driver = ClassInstance("DisturbanceGenerator", A_f=largest, A_d=0.0)
    driver.slave.set_real(driver.references("input"), [1.0] * 6)
    assert driver.step()
    assert driver.outputs() == [largest] * 6


@pytest.mark.parametrize("std", [1e7, 1e308])
def test_noise_that_could_hide_a_finite_position_is_refused(std):
    assert ClassInstance("AuvPlant", noise__std=std).get("fault") is True


def test_largest_noise_leaves_the_largest_position_finite():
    driver = ClassInstance("AuvPlant", noise__std=1e6, eta0__x=1e100)
    for _ in range(100):
        assert driver.step()
    assert all(isfinite(value) for value in driver.outputs())


def test_noise_of_a_refused_step_is_not_lost():
    """y after a refused step is y without it: the same numbers are drawn."""
    driver, calm = ClassInstance("AuvPlant"), ClassInstance("AuvPlant")
    driver.set(tau_w__p=1e300)
    driver.step()
    driver.set(tau_w__p=0.0)
    for other in (driver, calm):
        assert other.step()
    assert driver.get("y.z") == calm.get("y.z")


def test_each_seed_has_a_noise_of_its_own():
    seeds = [0, 1, -1, 2**31 - 1, -(2**31)]
    assert len({ClassInstance("AuvPlant", noise__seed=seed).get("y.x") for seed in seeds}) == 5


@pytest.mark.parametrize("pitch", [89.0, 90.0, -90.0, 100.0, 180.0])
def test_reference_does_not_start_steeper_than_its_equations_allow(pitch):
    driver = ClassInstance("MotionPlanner", eta0__theta=radians(pitch))
    assert f"{pitch:.1f} degrees" in driver.messages()[0]
    assert driver.answers() == [Fmi2Status.error]
    assert not driver.step()


@pytest.mark.parametrize("h_max", [0.02, 0.002])
def test_reference_stops_before_the_pole(h_max):
    """A moment that turns it over: the path ends where its pitch does, whatever the step."""
    driver = ClassInstance("MotionPlanner", tau_d__q=100.0, h_max=h_max)
    while driver.step():
        assert abs(driver.get("eta_d.theta")) <= radians(85.0)
    assert "pole" in driver.messages()[0]
    assert driver.time < 10.0


def test_messages_are_bounded():
    driver = ClassInstance("AuvPlant")
    for k in range(1000):
        driver.slave.get_real([10_000 + k])
    assert len(driver.messages()) == 100
    assert driver.answers() == [Fmi2Status.error] * 1000


@pytest.mark.parametrize(
    ("t", "h"), [(0.02, -0.02), (0.02, nan), (0.02, inf), (0.02, -inf), (nan, 0.02)]
)
def test_impossible_step_is_refused(driver, t, h):
    driver.excite(1)
    driver.step()
    before = driver.outputs()
    assert not driver.slave.do_step(t, h)
    assert driver.outputs() == before
    assert driver.get("fault") is True


def test_step_before_the_initialisation_is_refused():
    slave = component("MotionPlanner")(instance_name="under_test")
    assert not slave.do_step(0.0, 0.02)
    [entry] = slave.log_queue
    assert (entry.msg, entry.status) == (
        "fmi2DoStep is not allowed when instantiated",
        Fmi2Status.error,
    )
    assert slave.get_boolean([len(component("MotionPlanner").ports)]) == [False]


def test_zero_step_changes_nothing(driver):
    driver.excite(1)
    driver.step()
    before = driver.slave._get_fmu_state()
    driver.excite(2)
    assert driver.step(0.0)
    after = driver.slave._get_fmu_state()
    follow = {"inputs", "fresh", "held"}
    assert {key for key in before if after[key] != before[key]} <= follow


@pytest.mark.parametrize("name", WITH_STEP_LIMIT)
def test_long_step_is_as_many_short_ones_with_held_inputs(name):
    """0.1 s in one step against five of 20 ms; the noise is drawn once a communication step."""
    values = {"noise__std": 0.0} if name == "AuvPlant" else {}
    long, short = ClassInstance(name, **values), ClassInstance(name, **values)
    for driver in (long, short):
        driver.excite(4)
    assert long.step(0.1)
    for _ in range(5):
        assert short.step(0.1 / 5)
    assert long.slave._store.state == short.slave._store.state


@pytest.mark.parametrize("name", WITH_STEP_LIMIT)
def test_step_that_is_rounded_up_is_not_split(name):
    whole, rounded = ClassInstance(name), ClassInstance(name)
    assert whole.step(0.02)
    assert rounded.step(0.02 * (1 + 1e-10))
    for a, b in zip(whole.outputs(), rounded.outputs(), strict=True):
        assert a == pytest.approx(b, rel=1e-8, abs=1e-12)


def test_step_of_half_an_eternity_is_refused():
    driver = ClassInstance("MotionPlanner")
    assert not driver.step(1e9)
    assert "h_max" in driver.messages()[0]


def test_numbers_that_overflow_are_refused_and_the_state_is_kept():
    driver = ClassInstance("AuvPlant", m11=1e-9, tau_max__u=1e300)
    driver.set(tau__u=1e300)
    before = driver.slave._get_fmu_state()
    for _ in range(3):
        driver.step()
    assert driver.get("fault") is True
    assert driver.slave._get_fmu_state()["state"] == before["state"]


# Reasons: every refusal says in one line what was refused and why, and with which status.


def unknown(slave) -> int:
    """The first value reference that is none."""
    return len(slave._store.ports)


def from_json(**changes: Any):
    """A state with some parts changed."""

    def call(slave):
        saved = json.loads(json.dumps(slave._get_fmu_state()))
        slave._set_fmu_state({**saved, **changes})

    return call


def from_bytes(content: bytes):
    return lambda slave: slave._set_fmu_state(slave._fmu_state_from_bytes(content))


def terminated_then(call):
    def both(slave):
        slave.terminate()
        call(slave)

    return both


#: What is done to a DisturbanceGenerator that has been initialised, and what it says.
REASONS = {
    "no Real has the value reference 16": lambda s: s.get_real([unknown(s)]),
    "no Integer has the value reference 16": lambda s: s.set_integer([unknown(s)], [1]),
    "no Boolean has the value reference 0": lambda s: s.get_boolean([0]),
    "no String has the value reference 4294967295": lambda s: s.set_string([-1], ["a"]),
    "tau_w.u is an output and cannot be set": lambda s: s.set_real([6], [1.0]),
    "fault is an output and cannot be set": lambda s: s.set_boolean([15], [True]),
    "nu.u = nan: must be finite": lambda s: s.set_real([0], [nan]),
    "A_f = inf: must be finite": lambda s: s.set_real([12], [inf]),
    "fmi2SetReal is not allowed when terminated": terminated_then(lambda s: s.set_real([0], [1.0])),
    "fmi2SetString is not allowed when terminated": terminated_then(lambda s: s.set_string([], [])),
    "fmi2SetupExperiment is not allowed when stepping": lambda s: s.setup_experiment(0.0),
    "fmi2EnterInitializationMode is not allowed when stepping": (
        lambda s: s.enter_initialization_mode()
    ),
    "fmi2ExitInitializationMode is not allowed when terminated": terminated_then(
        lambda s: s.exit_initialization_mode()
    ),
    "step refused at t = 1 s: step -0.5 s is negative": lambda s: s.do_step(1.0, -0.5),
    "step refused at t = 1 s: time 1.0 and step nan must be finite": lambda s: s.do_step(1.0, nan),
    "step refused at t = nan s: time nan and step 0.5 must be finite": lambda s: s.do_step(
        nan, 0.5
    ),
    "step from 9.5 s to 10.5 s: the stop time is 10 s": lambda s: (
        from_json(stop_time=10.0)(s),
        s.do_step(9.5, 1.0),
    ),
    "fmi2DoStep is not allowed when terminated": terminated_then(lambda s: s.do_step(2.0, 0.5)),
    "state refused: the bytes are not a state": from_bytes(b"[1]"),
    "state refused: the bytes are not a state ": from_bytes(b"\xff"),
    "state refused: the bytes were changed since they were written": from_bytes(b"{}"),
    "state refused: not a state of fmus.disturbance_generator.DisturbanceGenerator": (
        from_json(identity="another")
    ),
    "state refused: it has missing or unknown parts": from_json(more=1),
    "state refused: 'bogus' is not a mode": from_json(mode="bogus"),
    "state refused: it has a state before the initialisation": from_json(mode="instantiated"),
    "state refused: its stop time is not after its start time": from_json(stop_time=-1.0),
    "state refused: its fault is neither true nor false": from_json(fault=0),
    "state refused: its outputs are neither fresh nor not": from_json(fresh=0),
    "state refused: it has missing or unknown parameters": from_json(parameters={}),
    "state refused: its values do not match the ports": from_json(inputs=[1.0]),
    "state refused: its values do not match the ports ": from_json(outputs=7),
    "state refused: it has steps without a state": from_json(state=None),
    "state refused: [0.0] instead of 0 values": from_json(state=[0.0]),
    "state refused: [1.0] instead of 0 values": from_json(draws=[1.0]),
    "state refused: '0' is not of type float": from_json(start_time="0"),
}

#: What is discarded; all else fails.
DISCARDED = ("must be finite", "negative")


@pytest.mark.parametrize("reason", REASONS)
def test_reason_is_logged_once_and_answered_each_time(reason):
    driver = ClassInstance("DisturbanceGenerator")
    discarded = any(words in reason for words in DISCARDED)
    status = Fmi2Status.discard if discarded else Fmi2Status.error
    for _ in range(2):
        REASONS[reason](driver.slave)
    [message] = [entry for entry in driver.slave.log_queue if entry.category != ANSWER]
    assert (message.msg, message.status) == (reason.strip(), status)
    assert driver.answers() == [status] * 2
    assert driver.get("fault") is discarded


def test_only_the_first_of_several_values_is_named():
    """The others have not been looked at: none of them is taken."""
    driver = ClassInstance("DisturbanceGenerator")
    driver.slave.set_real([0, 1, 2], [1.0, nan, inf])
    assert driver.messages() == ["nu.v = nan: must be finite"]
    assert driver.answers() == [Fmi2Status.discard]
    assert driver.slave.get_real([0, 1, 2]) == [0.0] * 3


def test_each_value_that_cannot_be_read_is_named():
    driver = ClassInstance("DisturbanceGenerator")
    driver.set(nu__u=7.0)
    assert driver.slave.get_real([0, 97, 98]) == [7.0, 0.0, 0.0]
    assert driver.messages() == [f"no Real has the value reference {n}" for n in (97, 98)]
