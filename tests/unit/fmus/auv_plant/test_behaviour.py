"""AuvPlant: limits that contradict each other, and the noise."""

from __future__ import annotations

import pytest
from pythonfmu.enums import Fmi2Status

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
