"""Each component as a Python class: values, refusals, steps and state."""

from __future__ import annotations

import json
from math import inf, nan

import pytest

from fmus.auv_plant.slave import AuvPlant
from fmus.disturbance_generator.slave import DisturbanceGenerator
from fmus.motion_planner.slave import MotionPlanner
from fmus.observer_controller.slave import ObserverController
from fmus.pd_controller.slave import PdController
from fmus.slave.component import Component

COMPONENTS = [AuvPlant, DisturbanceGenerator, MotionPlanner, ObserverController, PdController]
WITH_INPUTS = [AuvPlant, DisturbanceGenerator, ObserverController, PdController]
WITH_STEP_LIMIT = [AuvPlant, MotionPlanner, ObserverController, PdController]


class Driver:
    """A host in miniature: names instead of value references."""

    def __init__(self, component: type[Component], **values: object) -> None:
        self.slave = component(instance_name="under_test")
        self.ports = self.slave._store.ports
        self.slave.setup_experiment(0.0)
        self.set(**values)
        self.slave.enter_initialization_mode()
        self.slave.exit_initialization_mode()
        self.time = 0.0

    def reference(self, name: str) -> int:
        return [port.name for port in self.ports].index(name)

    def set(self, **values: object) -> None:
        for name, value in values.items():
            reference = self.reference(name.replace("__", "."))
            kind = self.ports[reference].kind.lower()
            getattr(self.slave, f"set_{kind}")([reference], [value])

    def get(self, name: str):
        reference = self.reference(name)
        kind = self.ports[reference].kind.lower()
        return getattr(self.slave, f"get_{kind}")([reference])[0]

    def outputs(self) -> list[float]:
        references = [
            i for i, p in enumerate(self.ports) if p.causality == "output" and p.kind == "Real"
        ]
        return list(self.slave.get_real(references))

    def excite(self, k: int) -> None:
        """Inputs of no special value, all in one call as a master does it."""
        references = [i for i, port in enumerate(self.ports) if port.causality == "input"]
        self.slave.set_real(references, [0.05 * ((i * 7 + k) % 11) - 0.2 for i in references])

    def step(self, h: float = 0.02) -> bool:
        accepted = self.slave.do_step(self.time, h)
        self.time += h
        return accepted

    def messages(self) -> list[str]:
        return [entry.msg for entry in self.slave.log_queue]


@pytest.fixture(params=COMPONENTS)
def driver(request: pytest.FixtureRequest) -> Driver:
    return Driver(request.param)


@pytest.fixture(params=WITH_INPUTS)
def driven(request: pytest.FixtureRequest) -> Driver:
    return Driver(request.param)


def first_input(driver: Driver) -> str:
    return driver.ports[0].name


def test_nothing_is_refused_in_a_normal_run(driver):
    for k in range(20):
        driver.excite(k)
        assert driver.step()
    assert driver.get("fault") is False
    assert driver.messages() == []


def test_parameters_report_their_declared_start_values(driver):
    for port in driver.ports:
        if port.causality == "parameter":
            assert driver.get(port.name) == port.start


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_bad_input_is_refused_and_the_next_good_one_cures_it(driven, bad):
    driven.excite(1)
    driven.step()
    before, name = driven.outputs(), first_input(driven)
    value_before = driven.get(name)
    driven.slave.set_real([0], [bad])
    assert driven.get("fault") is True
    assert driven.get(name) == value_before
    assert not driven.step()
    assert driven.outputs() == before
    assert name in driven.messages()[0]
    driven.slave.set_real([0], [0.25])
    assert driven.step()
    assert driven.get(name) == 0.25
    assert driven.get("fault") is True, "a fault stays until the component is reset"


@pytest.mark.parametrize("bad", [nan, inf])
def test_bad_input_among_good_ones_in_one_call_is_found(driven, bad):
    references = [i for i, port in enumerate(driven.ports) if port.causality == "input"]
    values = [0.5] * len(references)
    values[-1] = bad
    driven.slave.set_real(references, values)
    assert not driven.step()
    assert driven.get(first_input(driven)) == 0.5
    driven.excite(3)
    assert driven.step(), "a whole set of good inputs cures it"


def test_infinities_that_cancel_are_found():
    driver = Driver(AuvPlant)
    references = [i for i, port in enumerate(driver.ports) if port.causality == "input"]
    driver.slave.set_real(references, [inf, -inf] + [0.0] * (len(references) - 2))
    assert not driver.step()


@pytest.mark.parametrize(
    ("component", "name", "value"),
    [
        (AuvPlant, "m11", 0.0),
        (AuvPlant, "d66", -1.0),
        (AuvPlant, "noise__std", nan),
        (AuvPlant, "h_max", 0.0),
        (MotionPlanner, "m55", -22.5),
        (MotionPlanner, "tau_d__u", inf),
        (ObserverController, "eps_t", 0.0),
        (ObserverController, "saturation", "sigmoid"),
        (ObserverController, "k_d", -50.0),
        (DisturbanceGenerator, "omega_d", nan),
        (PdController, "sigma", -1.0),
    ],
)
def test_wrong_parameter_is_refused_and_no_step_is_made_with_another_value(component, name, value):
    driver = Driver(component, **{name: value})
    dotted = name.replace("__", ".")
    assert driver.get("fault") is True
    assert driver.get(dotted) != value
    assert dotted in driver.messages()[0]
    assert not driver.step()


def test_parameters_that_contradict_each_other_are_refused():
    driver = Driver(AuvPlant, tau_min__q=0.0, tau_max__q=0.0)
    assert driver.get("fault") is True
    assert "tau_min.q" in driver.messages()[0]
    assert not driver.step()


def test_a_parameter_can_be_mended_before_the_initialisation():
    slave = AuvPlant(instance_name="under_test")
    reference = [port.name for port in AuvPlant.ports].index("m11")
    slave.set_real([reference], [-1.0])
    slave.set_real([reference], [30.0])
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    assert slave.do_step(0.0, 0.02)


def test_outputs_and_fixed_parameters_cannot_be_set_during_the_run(driver):
    before = driver.outputs()
    output = next(port.name for port in driver.ports if port.causality == "output")
    driver.set(**{output.replace(".", "__"): 9.0})
    assert driver.get("fault") is True
    assert driver.outputs() == before
    for port in driver.ports:
        if port.causality == "parameter" and port.variability == "fixed" and port.kind == "Real":
            driver.set(**{port.name.replace(".", "__"): port.start + 1.0})
            assert driver.get(port.name) == port.start


def test_a_tunable_parameter_acts_from_the_next_step():
    driver = Driver(DisturbanceGenerator, A_d=0.0)
    driver.set(nu__u=1.0)
    driver.step()
    assert driver.get("tau_w.u") == 0.5
    driver.set(A_f=0.75)
    driver.step()
    assert driver.get("tau_w.u") == 0.75
    assert driver.get("fault") is False


def test_unknown_value_references_are_reported_and_do_no_harm(driver):
    assert driver.slave.get_real([10_000, -1]) == [0.0, 0.0]
    driver.slave.set_real([10_000], [1.0])
    driver.slave.set_boolean([0], [True])
    assert driver.get("fault") is True
    assert driver.step()


@pytest.mark.parametrize("h", [-0.02, nan, inf, -inf])
def test_impossible_step_is_refused(driver, h):
    driver.excite(1)
    driver.step()
    before = driver.outputs()
    assert not driver.slave.do_step(0.02, h)
    assert driver.outputs() == before
    assert driver.get("fault") is True


def test_impossible_time_is_refused(driver):
    assert not driver.slave.do_step(nan, 0.02)
    assert driver.get("fault") is True


def test_step_before_the_initialisation_is_refused():
    slave = MotionPlanner(instance_name="under_test")
    assert not slave.do_step(0.0, 0.02)
    assert slave.get_boolean([len(MotionPlanner.ports)]) == [True]


def test_refusal_before_the_initialisation_says_why():
    slave = AuvPlant(instance_name="under_test")
    assert not slave.do_step(0.0, 0.02)
    assert "not initialised" in slave.log_queue[0].msg


@pytest.mark.parametrize("key", ["hidden", "inputs", "outputs", "parameters"])
def test_state_that_is_refused_is_not_applied_in_part(key: str):
    whole, other = Driver(AuvPlant), Driver(AuvPlant, m11=50.0)
    whole.step(), other.step()
    spoiled = {**other.slave._get_fmu_state(), key: {"m11": 50.0} if key == "parameters" else [1]}
    whole.slave._set_fmu_state(spoiled)
    assert whole.get("fault") is True
    untouched = Driver(AuvPlant)
    untouched.step()
    for driver in (whole, untouched):
        driver.excite(3)
        assert driver.step()
    assert whole.outputs() == untouched.outputs()


def test_zero_step_changes_nothing(driver):
    driver.excite(1)
    driver.step()
    before = driver.slave._get_fmu_state()
    driver.excite(2)
    assert driver.step(0.0)
    after = driver.slave._get_fmu_state()
    before.pop("inputs"), after.pop("inputs")
    assert after == before


@pytest.mark.parametrize("component", WITH_STEP_LIMIT)
def test_long_step_is_as_many_short_ones_with_held_inputs(component):
    """0.1 s in one step against five of 20 ms; the noise is drawn once a communication step."""
    values = {"noise__std": 0.0} if component is AuvPlant else {}
    long, short = Driver(component, **values), Driver(component, **values)
    for driver in (long, short):
        driver.excite(4)
    assert long.step(0.1)
    for _ in range(5):
        assert short.step(0.1 / 5)
    assert long.slave._state == short.slave._state


@pytest.mark.parametrize("component", WITH_STEP_LIMIT)
def test_step_that_is_rounded_up_is_not_split(component):
    whole, rounded = Driver(component), Driver(component)
    assert whole.step(0.02)
    assert rounded.step(0.02 * (1 + 1e-10))
    for a, b in zip(whole.outputs(), rounded.outputs(), strict=True):
        assert a == pytest.approx(b, rel=1e-8, abs=1e-12)


def test_step_of_half_an_eternity_is_refused():
    driver = Driver(MotionPlanner)
    assert not driver.step(1e9)
    assert "h_max" in driver.messages()[0]


def test_noise_is_drawn_once_a_communication_step_whatever_its_length():
    one, many = Driver(AuvPlant), Driver(AuvPlant, h_max=0.001)
    one.step(), many.step()
    assert one.get("y.x") - many.get("y.x") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("component", COMPONENTS)
@pytest.mark.parametrize("serialised", [False, True])
def test_run_continued_from_a_state_is_the_same_run_bit_for_bit(component, serialised):
    driver = Driver(component)
    for k in range(50):
        driver.excite(k)
        driver.step()
    saved, time = driver.slave._get_fmu_state(), driver.time
    if serialised:
        saved = component._fmu_state_from_bytes(component._fmu_state_to_bytes(saved))

    def continued(other: Driver) -> list[list[float]]:
        rows = []
        other.time = time
        for k in range(50, 100):
            other.excite(k)
            assert other.step()
            rows.append(other.outputs())
        return rows

    expected = continued(driver)
    driver.slave._set_fmu_state(saved)
    assert continued(driver) == expected
    fresh = Driver(component)
    fresh.slave._set_fmu_state(saved)
    assert continued(fresh) == expected


def test_state_holds_parameters_faults_and_inputs(driven):
    driven.slave.set_real([0], [nan])
    other = Driver(type(driven.slave))
    other.slave._set_fmu_state(driven.slave._get_fmu_state())
    assert other.get("fault") is True
    assert not other.step()


def test_state_of_another_component_or_version_is_refused(driver):
    driver.step()
    before = driver.slave._get_fmu_state()
    driver.slave._set_fmu_state({**before, "identity": "something else"})
    driver.slave._set_fmu_state({})
    driver.slave._set_fmu_state(driver.slave._fmu_state_from_bytes(b"\x00 not a state"))
    driver.slave._set_fmu_state(driver.slave._fmu_state_from_bytes(b"[1, 2]"))
    assert driver.get("fault") is True
    after = driver.slave._get_fmu_state()
    assert {**after, "fault": False} == before


def test_saved_state_does_not_change_with_the_run(driver):
    driver.excite(1)
    driver.step()
    saved = driver.slave._get_fmu_state()
    text = json.dumps(saved)
    driver.excite(2)
    driver.step()
    assert json.dumps(saved) == text


def test_message_with_a_percent_sign_is_no_format_for_the_host():
    driver = Driver(ObserverController, saturation="%s%n")
    assert "%%s%%n" in driver.messages()[0]


def test_same_refusal_again_and_again_is_logged_once():
    driver = Driver(MotionPlanner)
    for _ in range(10):
        driver.slave.do_step(0.0, -1.0)
    assert len(driver.messages()) == 1


def test_gate_is_logged_and_is_no_fault():
    driver = Driver(ObserverController)
    driver.set(y__x=5.0)
    assert driver.step()
    assert "observer restarted" in driver.messages()[0]
    assert driver.get("y_hat.x") == 5.0
    assert driver.get("fault") is False


def test_numbers_that_overflow_are_refused_and_the_state_is_kept():
    driver = Driver(AuvPlant, m11=1e-9, tau_max__u=1e300)
    driver.set(tau__u=1e300)
    before = driver.slave._get_fmu_state()
    for _ in range(3):
        driver.step()
    assert driver.get("fault") is True
    assert driver.slave._get_fmu_state()["state"] == before["state"]
