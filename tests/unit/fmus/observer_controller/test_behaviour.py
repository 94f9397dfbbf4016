"""ObserverController: the gate."""

from __future__ import annotations

from support.instances import ClassInstance


def test_gate_is_logged_and_is_no_fault():
    driver = ClassInstance("ObserverController")
    driver.set(y__x=5.0)
    assert driver.step()
    assert "observer restarted" in driver.messages()[0]
    assert driver.get("y_hat.x") == 5.0
    assert driver.get("fault") is False
