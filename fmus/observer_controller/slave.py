"""ObserverController: the proposed velocity-free saturated controller."""

from __future__ import annotations

from typing import TypedDict

from pythonfmu.enums import Fmi2Status

from auv_fmu import output_feedback
from auv_fmu.output_feedback import ControllerState, Gains, Measurement, Signals
from auv_fmu.types import Vector3, Vector4
from fmus.observer_controller.ports import PARAMETERS, PORTS
from fmus.ports.controllers import GROUP_OF
from fmus.slave.component import Component


class Outputs(TypedDict):
    """The command, and what the controller knows."""

    tau: Vector3
    y_hat: Vector3
    dy_hat: Vector3
    theta_hat: Vector4
    e: Vector3
    z: Vector3


class ObserverController(Component[ControllerState, Measurement, Outputs, Gains]):
    """(16) to (24), or (48) to (51): position and attitude in, force and moments out.

    A sampled controller: its outputs are those of the beginning of the step, when the
    measurements were taken.
    """

    description = "Saturated output-feedback tracking controller with velocity observer"
    ports = PORTS
    parameter_set = PARAMETERS
    group_of = GROUP_OF

    def begin(self, inputs: Measurement, t: float) -> tuple[ControllerState, Outputs]:
        state = output_feedback.initial_state(self.parameters, inputs.y)
        return state, _seen(state, output_feedback.evaluate(self.parameters, state, inputs))

    def advance(
        self, state: ControllerState, inputs: Measurement, t: float, h: float, n: int
    ) -> tuple[ControllerState, Outputs]:
        gains = self.parameters
        credible = output_feedback.gated(gains, state, inputs.y)
        if credible is not state:
            self.say(
                f"observer restarted at t = {t:g} s: the measured position moved further than "
                "innovation_gate",
                Fmi2Status.warning,
                key="observer restarted",
            )
        signals = output_feedback.evaluate(gains, credible, inputs)
        outputs = _seen(credible, signals)
        state = output_feedback.step(credible, signals, h)
        while n > 1:
            signals = output_feedback.evaluate(gains, state, inputs)
            state = output_feedback.step(state, signals, h)
            n -= 1
        return state, outputs


def _seen(state: ControllerState, signals: Signals) -> Outputs:
    return {
        "tau": signals.tau,
        "y_hat": state.y_hat,
        "dy_hat": signals.dy_hat,
        "theta_hat": state.theta_hat,
        "e": signals.e,
        "z": signals.z,
    }
