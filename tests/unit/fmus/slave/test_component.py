"""Each component as a Python class: values, refusals and steps."""

from __future__ import annotations

from math import inf, nan

import pytest

from support.instances import NAMES, WITH_INPUTS, ClassInstance, component

WITH_STEP_LIMIT = [name for name in NAMES if name != "DisturbanceGenerator"]


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
    references = driven.references("input")
    values = [0.5] * len(references)
    values[-1] = bad
    driven.slave.set_real(references, values)
    assert not driven.step()
    assert driven.get(first_input(driven)) == 0.5
    driven.excite(3)
    assert driven.step(), "a whole set of good inputs cures it"


def test_infinities_that_cancel_are_found():
    driver = ClassInstance("AuvPlant")
    references = driver.references("input")
    driver.slave.set_real(references, [inf, -inf] + [0.0] * (len(references) - 2))
    assert not driver.step()


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
        ("ObserverController", "saturation", "sigmoid"),
        ("ObserverController", "k_d", -50.0),
        ("DisturbanceGenerator", "omega_d", nan),
        ("PdController", "sigma", -1.0),
    ],
)
def test_wrong_parameter_is_refused_and_no_step_is_made_with_another_value(name, parameter, value):
    driver = ClassInstance(name, **{parameter: value})
    dotted = parameter.replace("__", ".")
    assert driver.get("fault") is True
    assert driver.get(dotted) != value
    assert dotted in driver.messages()[0]
    assert not driver.step()


def test_a_parameter_can_be_mended_before_the_initialisation():
    slave = component("AuvPlant")(instance_name="under_test")
    reference = [port.name for port in component("AuvPlant").ports].index("m11")
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
    driver = ClassInstance("DisturbanceGenerator", A_d=0.0)
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
    slave = component("MotionPlanner")(instance_name="under_test")
    assert not slave.do_step(0.0, 0.02)
    assert slave.get_boolean([len(component("MotionPlanner").ports)]) == [True]


def test_refusal_before_the_initialisation_says_why():
    slave = component("AuvPlant")(instance_name="under_test")
    assert not slave.do_step(0.0, 0.02)
    assert "not initialised" in slave.log_queue[0].msg


def test_zero_step_changes_nothing(driver):
    driver.excite(1)
    driver.step()
    before = driver.slave._get_fmu_state()
    driver.excite(2)
    assert driver.step(0.0)
    after = driver.slave._get_fmu_state()
    before.pop("inputs"), after.pop("inputs")
    assert after == before


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
    assert long.slave._state == short.slave._state


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


def test_message_with_a_percent_sign_is_no_format_for_the_host():
    driver = ClassInstance("ObserverController", saturation="%s%n")
    assert "%%s%%n" in driver.messages()[0]


def test_same_refusal_again_and_again_is_logged_once():
    driver = ClassInstance("MotionPlanner")
    for _ in range(10):
        driver.slave.do_step(0.0, -1.0)
    assert len(driver.messages()) == 1


def test_numbers_that_overflow_are_refused_and_the_state_is_kept():
    driver = ClassInstance("AuvPlant", m11=1e-9, tau_max__u=1e300)
    driver.set(tau__u=1e300)
    before = driver.slave._get_fmu_state()
    for _ in range(3):
        driver.step()
    assert driver.get("fault") is True
    assert driver.slave._get_fmu_state()["state"] == before["state"]
