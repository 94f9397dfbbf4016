"""ObserverController: the gate, and steps of several lengths with an exact observer."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal
from auv_fmu.paper import output_feedback
from auv_fmu.paper.observer import Form
from auv_fmu.paper.output_feedback import ControllerState, Gains, Measurement
from fmus.observer_controller import component
from support.instances import ClassInstance
from support.strategies import speeds, vectors

three = vectors(speeds, 3)


def test_gate_is_logged_without_a_fault():
    driver = ClassInstance("ObserverController")
    driver.set(y__x=5.0)
    assert driver.step()
    assert "observer restarted" in driver.messages()[0]
    assert driver.get("y_hat.x") == 5.0
    assert driver.get("fault") is False


@given(three, three, st.sampled_from(Form), st.floats(0.0, 0.1), st.floats(1e-3, 0.1))
def test_command_is_for_a_step_like_the_last_and_the_state_for_the_one_that_is_taken(
    y, y_hat, form, last, h
):
    gains, still = Gains(form=form), (0.0, 0.0, 0.0)
    state = ControllerState(y_hat, still, gains.theta_0, last)
    measured = Measurement(y, still, still, still, still)
    derived = component.derive(gains, state, measured)
    assert derived == output_feedback.evaluate(gains, state, measured, last)
    after = component.update(gains, state, derived, measured, h)
    exact = output_feedback.evaluate(gains, state, measured, h)
    assert after == output_feedback.step(state, exact, h)
    assert after.h == h


def test_state_after_a_step_that_went_back_is_refused():
    still = (0.0, 0.0, 0.0)
    state = ControllerState(still, still, (0.0,) * 4, 0.0)
    component.check_state(state)
    with pytest.raises(Refusal, match="shorter than zero"):
        component.check_state(state._replace(h=-0.02))
