"""Each component as a Python class: values, refusals and steps."""

from __future__ import annotations

from math import inf, isfinite, nan, radians

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
        ("AuvPlant", "actuator__T__u", -0.1),
        ("AuvPlant", "current__x", nan),
        ("ObserverController", "saturation", "sigmoid"),
        ("ObserverController", "observer", "kalman"),
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


REFUSED_CALLS = {
    "unknown reference read": lambda slave: slave.get_real([10_000]),
    "negative reference read": lambda slave: slave.get_real([-1]),
    "unknown reference set": lambda slave: slave.set_real([10_000], [1.0]),
    "wrong type read": lambda slave: slave.get_boolean([0]),
    "wrong type set": lambda slave: slave.set_string([0], ["one"]),
    "output set": lambda slave: slave.set_real([output_of(slave)], [1.0]),
    "fixed parameter set": lambda slave: slave.set_real([fixed_of(slave)], [1.0]),
    "empty state": lambda slave: slave._set_fmu_state({}),
    "truncated state": lambda slave: slave._set_fmu_state(
        slave._fmu_state_from_bytes(slave._fmu_state_to_bytes(slave._get_fmu_state())[:-9])
    ),
    "experiment set up again": lambda slave: slave.setup_experiment(0.0),
    "initialisation entered again": lambda slave: slave.enter_initialization_mode(),
    "initialisation left again": lambda slave: slave.exit_initialization_mode(),
}


def output_of(slave) -> int:
    return slave._store.output_references[0]


def fixed_of(slave) -> int:
    return next(r for r, port in enumerate(slave.ports) if port.variability == "fixed")


@pytest.mark.parametrize("call", REFUSED_CALLS)
def test_after_a_refused_call_no_step_is_taken_until_a_state_is_restored(driver, call):
    driver.excite(1)
    driver.step()
    before, saved = driver.outputs(), driver.slave._get_fmu_state()
    if call == "fixed parameter set" and driver.component.__name__ == "DisturbanceGenerator":
        pytest.skip("all of its parameters are tunable")
    REFUSED_CALLS[call](driver.slave)
    assert driver.get("fault") is True
    assert driver.messages()
    for _ in range(2):
        assert not driver.step()
    assert driver.outputs() == before
    driver.slave._set_fmu_state(saved)
    assert driver.get("fault") is False
    assert driver.step()


def test_values_of_unknown_references_are_zero(driver):
    assert driver.slave.get_real([10_000, -1]) == [0.0, 0.0]


def test_reference_beyond_two_to_the_31_is_named_as_the_host_knows_it(driver):
    """PythonFMU hands references over as signed numbers."""
    driver.slave.get_real([-1])
    assert "4294967295" in driver.messages()[0]


@pytest.mark.parametrize("start", [nan, inf, -inf])
def test_bad_start_time_is_refused_and_a_good_one_cures_it(start):
    for mended in (False, True):
        slave = component("DisturbanceGenerator")(instance_name="under_test")
        slave.setup_experiment(start)
        if mended:
            slave.setup_experiment(1.0)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        assert slave.do_step(1.0, 0.02) is mended
        assert slave._store.fault is True


@pytest.mark.parametrize("stop", [nan, -1.0, -inf])
def test_bad_stop_time_is_refused(driver, stop):
    slave = driver.component(instance_name="under_test")
    slave.setup_experiment(0.0, stop)
    assert slave._store.fault is True


def test_initialisation_cannot_be_left_before_it_was_entered():
    slave = component("AuvPlant")(instance_name="under_test")
    slave.exit_initialization_mode()
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    assert not slave.do_step(0.0, 0.02)


def test_after_the_end_nothing_is_set_or_stepped_and_everything_can_be_read(driven):
    driven.excite(1)
    driven.step()
    before = driven.outputs()
    driven.slave.terminate()
    assert driven.get("fault") is False
    assert not driven.step()
    assert "terminated" in driven.messages()[0]
    driven.slave.set_real([0], [7.0])
    assert driven.get(first_input(driven)) != 7.0
    assert driven.outputs() == before


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
    driver.set(**dict.fromkeys(sample, 0.0))
    for k in range(3):
        for other in (driver, calm):
            other.excite(k)
            assert other.step()
    assert driver.outputs() == calm.outputs()


def test_initial_values_without_a_next_step_are_refused():
    driver = ClassInstance("AuvPlant", nu0__p=1e160)
    assert "initialisation refused" in driver.messages()[0]
    assert not driver.step()


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
    assert len(driver.slave._store.refused) == 1


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
