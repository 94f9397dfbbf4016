"""Remus100: impossible hulls, impossible states, and inputs without a source."""

from __future__ import annotations

import pytest
from pythonfmu.enums import Fmi2Status

from auv_fmu import Refusal
from auv_fmu.remus import remus100
from auv_fmu.remus.prestero import Coefficients
from auv_fmu.remus.remus100 import Form, Parameters
from fmus.remus100.component import check, check_state
from support.instances import ClassInstance


@pytest.mark.parametrize(
    ("name", "value", "good"),
    [
        ("diameter", 1.5, 0.2),
        ("length", 0.2, 1.6),
        ("r_bg__z", 0.0, 0.02),
        ("net_buoyancy", -305.0, 7.0),
        ("net_buoyancy", 155.0, 152.0),
    ],
)
def test_hulls_that_the_model_does_not_hold_for_are_refused(name, value, good):
    driver = ClassInstance("Remus100", **{name: value})
    assert name.replace("__", ".") in driver.messages()[0]
    assert driver.answers() == [Fmi2Status.error]
    driver.set(**{name: good})
    driver.slave.exit_initialization_mode()
    assert driver.step()


def test_coefficients_that_leave_no_mass_are_refused_where_they_are_used():
    wrong = Coefficients()._replace(N=(1.93, 3.5, -3.18, -94.0, -24.0, -1.93, -2.0, -4.86))
    check(Parameters(coefficients=wrong))
    check(Parameters(form=Form.COEFFICIENTS))
    with pytest.raises(Refusal, match=r"is -0\.05; it must be above 0: mend"):
        check(Parameters(form=Form.COEFFICIENTS, coefficients=wrong))


def test_a_vehicle_that_nothing_commands_stays_where_it_is():
    driver = ClassInstance("Remus100", noise__std=0.0)
    before = driver.outputs()
    for _ in range(50):
        assert driver.step()
    assert driver.outputs() == pytest.approx(before, abs=1e-12)


def test_water_beyond_the_model_is_refused_and_the_next_step_is_taken():
    driver = ClassInstance("Remus100", noise__std=0.0)
    driver.step()
    before = driver.outputs()
    driver.set(water__y=50.0)
    assert not driver.step()
    assert "50 m/s through the water" in driver.messages()[-1]
    driver.set(water__y=0.0)
    assert driver.step()
    assert driver.outputs() == pytest.approx(before, abs=1e-12)


@pytest.mark.parametrize("actuator", [(0.27, 0.0, 0.0), (0.0, -0.27, 0.0), (0.0, 0.0, 160.0)])
def test_state_with_an_actuator_beyond_its_limit_is_refused(actuator):
    state = remus100.begin(Parameters(), (0.0, 0.0, 0.0))
    check_state(Parameters(), state)
    with pytest.raises(Refusal, match="beyond their limits"):
        check_state(Parameters(), state._replace(actuator=actuator))


def test_state_beyond_the_model_is_refused():
    state = remus100.begin(Parameters(), (0.0, 0.0, 0.0))
    with pytest.raises(Refusal):
        check_state(Parameters(), state._replace(nu=(11.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
