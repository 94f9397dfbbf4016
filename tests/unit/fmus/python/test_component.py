"""Each component as a Python class: values, refusals and steps."""

from __future__ import annotations

from math import inf, isfinite, nan, radians

import pytest
from pythonfmu.enums import Fmi2Status

from fmus.ports.port import H_MAX
from support.instances import ClassInstance, answers_of, component, messages_of
from support.settings import NAMES, REPRESENTATIVES, ports_of

WITH_STEP_LIMIT = [name for name in NAMES if H_MAX in {port.name for port in ports_of(name)}]


@pytest.fixture(params=REPRESENTATIVES)
def driver(request: pytest.FixtureRequest) -> ClassInstance:
    return ClassInstance(request.param)


def test_infinities_that_cancel_are_found():
    driver = ClassInstance("AuvPlant")
    references = driver.references("input")
    driver.slave.set_real(references, [inf, -inf] + [0.0] * (len(references) - 2))
    assert driver.answers() == [Fmi2Status.discard]


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("AuvPlant", "m11", 0.0), ("AuvPlant", "d66", -1.0), ("AuvPlant", "noise__std", nan),
        ("AuvPlant", "h_max", 0.0), ("MotionPlanner", "m55", -22.5),
        ("MotionPlanner", "tau_d__u", inf), ("ObserverController", "eps_t", 0.0),
        ("AuvPlant", "actuator__T__u", -0.1), ("AuvPlant", "current__x", nan),
        ("ObserverController", "saturation", 4), ("ObserverController", "observer", -1),
        ("ObserverController", "k_d", -50.0), ("DisturbanceGenerator", "omega_d", nan),
        ("PdController", "sigma", -1.0),
    ],
)  # fmt: skip
def test_wrong_parameter_is_an_error_before_the_run(name, parameter, value):
    """Some hosts ignore fmi2Discard: they would run with the earlier value."""
    driver = ClassInstance(name, **{parameter: value})
    dotted = parameter.replace("__", ".")
    [port] = [port for port in driver.ports if port.name == dotted]
    assert driver.answers() == [Fmi2Status.error]
    assert driver.get("fault") is True
    assert driver.get(dotted) == port.start
    assert dotted in driver.messages()[0]


def test_without_a_loader_no_step_is_made_with_another_value():
    """The host was answered fmi2OK, and must not have to find out by its results."""
    driver = ClassInstance("AuvPlant", plain=True, m11=0.0)
    assert driver.answers() == []
    for _ in range(2):
        assert not driver.step()
    driver.set(m11=30.0)
    assert not driver.step(), "a good value is no answer"


def test_integers_and_truth_values_can_be_read_as_numbers(driver):
    """Some hosts read all outputs with fmi2GetReal."""
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
def test_one_wild_sample_is_refused_and_the_run_continues(name, start, sample):
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
    """y after a refused step equals y without it: the same numbers are drawn."""
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


def test_numbers_that_overflow_are_refused_and_the_state_is_kept():
    driver = ClassInstance("AuvPlant", m11=1e-9, tau_max__u=1e300)
    driver.set(tau__u=1e300)
    before = driver.slave._get_fmu_state()
    for _ in range(3):
        driver.step()
    assert driver.get("fault") is True
    assert driver.slave._get_fmu_state()["state"] == before["state"]
