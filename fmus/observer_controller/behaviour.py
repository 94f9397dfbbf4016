"""How ObserverController runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`.

A sampled controller: its outputs belong to the beginning of the step, when the measurements
were taken.
"""

from __future__ import annotations

from typing import TypedDict

from auv_fmu import output_feedback
from auv_fmu.output_feedback import ControllerState, Gains, Measurement, Signals
from auv_fmu.vectors import Vector3, Vector4

#: What is said, at time t [s], of a measurement that is not credible.
RESTARTED = (
    "observer restarted at t = {t:g} s: the measured position is further from its estimate than "
    "innovation_gate"
)


class Outputs(TypedDict):
    """The command, and what the controller knows."""

    tau: Vector3
    y_hat: Vector3
    dy_hat: Vector3
    theta_hat: Vector4
    e: Vector3
    z: Vector3


def begin(parameters: Gains, inputs: Measurement) -> tuple[ControllerState, Outputs]:
    """State and outputs at the start, where z = 0 and no gain of the observer matters."""
    state = output_feedback.initial_state(parameters, inputs.y)
    return state, _seen(state, output_feedback.evaluate(parameters, state, inputs, 0.0))


def credible(parameters: Gains, state: ControllerState, inputs: Measurement) -> bool:
    """Whether a step may go on from a state."""
    return output_feedback.credible(parameters, state, inputs.y)


def restarted(parameters: Gains, state: ControllerState, inputs: Measurement) -> ControllerState:
    """The state that a step goes on from if it may not."""
    return output_feedback.restarted(parameters, state, inputs.y)


def advance(
    parameters: Gains, state: ControllerState, inputs: Measurement, h: float, n: int
) -> tuple[ControllerState, Outputs]:
    """State after n steps of h seconds, and outputs at the beginning of the first."""
    signals = output_feedback.evaluate(parameters, state, inputs, h)
    after = output_feedback.steps(parameters, state, signals, inputs, h, n)
    return after, _seen(state, signals)


def _seen(state: ControllerState, signals: Signals) -> Outputs:
    return {
        "tau": signals.tau,
        "y_hat": state.y_hat,
        "dy_hat": signals.dy_hat,
        "theta_hat": state.theta_hat,
        "e": signals.e,
        "z": signals.z,
    }
