"""AuvPlant: limits that contradict each other, its actuators, the noise, impossible states."""

from __future__ import annotations

import pytest
from pythonfmu.enums import Fmi2Status

from auv_fmu import Refusal
from auv_fmu.paper import plant
from auv_fmu.paper.plant import Parameters, RollAxis
from fmus.auv_plant.component import check_state
from support.instances import ClassInstance


def test_parameters_that_contradict_each_other_are_refused():
    """Once all are known: which one comes first is the host's choice."""
    driver = ClassInstance("AuvPlant", tau_min__q=0.0, tau_max__q=0.0)
    assert "tau_min.q" in driver.messages()[0]
    assert driver.answers() == [Fmi2Status.error]
    driver.set(tau_min__q=-1.0)
    driver.slave.exit_initialization_mode()
    assert driver.step()


def test_noise_is_drawn_once_a_communication_step_whatever_its_length():
    one, many = ClassInstance("AuvPlant"), ClassInstance("AuvPlant", h_max=0.001)
    one.step(), many.step()
    assert one.get("y.x") - many.get("y.x") == pytest.approx(0.0, abs=1e-12)


def test_what_acts_follows_the_command_at_once_where_there_is_no_lag():
    driver = ClassInstance("AuvPlant", actuator__T__q=0.5)
    driver.set(tau__u=100.0, tau__q=10.0, tau__r=-7.0)
    assert [driver.get(f"tau_applied.{k}") for k in "uqr"] == [80.0, 0.0, -7.0]
    assert driver.step()
    driver.set(tau__u=1.0, tau__q=0.0)
    assert driver.get("tau_applied.u") == 1.0
    assert 0.0 < driver.get("tau_applied.q") < 10.0


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"quaternion": (1.0, 0.1, 0.0, 0.0)}, "not of length one"),
        ({"tau": (80.1, 0.0, 0.0)}, "beyond their limits"),
        ({"tau": (0.0, 0.0, -80.1)}, "beyond their limits"),
        ({"quaternion": (0.8, 0.6, 0.0, 0.0)}, "its roll"),
        ({"nu_r": (0.0, 0.0, 0.0, 0.1, 0.0, 0.0)}, "its roll"),
    ],
)
def test_state_that_no_run_leads_to_is_refused(change, why):
    parameters = Parameters(roll=RollAxis(rolls=False))
    state = plant.begin(parameters, (0.0, 0.0, 0.0))
    check_state(parameters, state._replace(tau=(80.0, -80.0, 0.0)))
    with pytest.raises(Refusal, match=why):
        check_state(parameters, state._replace(**change))
