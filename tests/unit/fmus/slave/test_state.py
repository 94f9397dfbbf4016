"""The state of a component: complete, exact, and refused whole or not at all."""

from __future__ import annotations

import json
from math import nan

import pytest

from support.instances import NAMES, WITH_INPUTS, ClassInstance


@pytest.fixture(params=NAMES)
def driver(request: pytest.FixtureRequest) -> ClassInstance:
    return ClassInstance(request.param)


@pytest.fixture(params=WITH_INPUTS)
def driven(request: pytest.FixtureRequest) -> ClassInstance:
    return ClassInstance(request.param)


@pytest.mark.parametrize("key", ["hidden", "inputs", "outputs", "parameters"])
def test_state_that_is_refused_is_not_applied_in_part(key: str):
    whole, other = ClassInstance("AuvPlant"), ClassInstance("AuvPlant", m11=50.0)
    whole.step(), other.step()
    spoiled = {**other.slave._get_fmu_state(), key: {"m11": 50.0} if key == "parameters" else [1]}
    whole.slave._set_fmu_state(spoiled)
    assert whole.get("fault") is True
    untouched = ClassInstance("AuvPlant")
    untouched.step()
    for driver in (whole, untouched):
        driver.excite(3)
        assert driver.step()
    assert whole.outputs() == untouched.outputs()


@pytest.mark.parametrize("serialised", [False, True])
def test_run_continued_from_a_state_is_the_same_run_bit_for_bit(driver, serialised):
    driver.run(0, 50)
    saved, time = driver.slave._get_fmu_state(), driver.time
    if serialised:
        saved = driver.component._fmu_state_from_bytes(driver.component._fmu_state_to_bytes(saved))
    expected = driver.run(50, 100)
    for other in (driver, ClassInstance(driver.component.__name__)):
        other.slave._set_fmu_state(saved)
        other.time = time
        assert other.run(50, 100) == expected


def test_state_holds_parameters_faults_and_inputs(driven):
    driven.slave.set_real([0], [nan])
    other = ClassInstance(driven.component.__name__)
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
