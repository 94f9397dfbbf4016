"""BlueRov2Heavy: impossible thrusters, impossible states, and what its outputs are."""

from __future__ import annotations

import pytest
from pythonfmu.enums import Fmi2Status

from auv_fmu import Refusal, Vector
from auv_fmu.bluerov2 import bluerov2
from auv_fmu.bluerov2.bluerov2 import Parameters
from fmus.blue_rov2_heavy.component import check_state
from support.instances import ClassInstance

STATE = bluerov2.begin(Parameters(), (0.0, 0.0, 0.0))


def test_a_direction_that_is_not_of_length_one_is_refused():
    driver = ClassInstance("BlueRov2Heavy", **{"thruster[7].e_z": -2.0})
    assert "thruster[7]" in driver.messages()[0]
    assert driver.answers() == [Fmi2Status.error]
    driver.set(**{"thruster[7].e_z": -1.0})
    driver.slave.exit_initialization_mode()
    assert driver.step()


def test_water_beyond_the_model_is_refused_and_the_next_step_is_taken():
    driver = ClassInstance("BlueRov2Heavy", noise__std=0.0)
    driver.step()
    before = driver.outputs()
    driver.set(water__y=50.0)
    assert not driver.step()
    assert "50 m/s through the water" in driver.messages()[-1]
    assert driver.outputs() == before
    driver.set(water__y=0.0)
    assert driver.step()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"quaternion": (1.0, 0.0, 0.0, 1e-5)}, "length one"),
        ({"thrust": Vector((0.0,) * 7 + (54.0,))}, "beyond their limits"),
        ({"thrust": Vector((-42.0,) + (0.0,) * 7)}, "beyond their limits"),
        ({"nu_r": (0.0, 5.1, 0.0, 0.0, 0.0, 0.0)}, "the model ends"),
    ],
)
def test_states_to_which_no_run_leads_are_refused(change, why):
    check_state(Parameters(), STATE)
    with pytest.raises(Refusal, match=why):
        check_state(Parameters(), STATE._replace(**change))
