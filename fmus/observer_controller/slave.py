"""ObserverController: the proposed velocity-free saturated controller."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pythonfmu.enums import Fmi2Status

from auv_fmu import output_feedback
from auv_fmu.output_feedback import ControllerState, Gains, Measurement, Signals
from auv_fmu.saturation import SATURATIONS
from fmus.observer_controller.ports import PORTS
from fmus.ports.controllers import vector
from fmus.slave.component import Component


class ObserverController(Component):
    """(16) to (24), or (48) to (51): position and attitude in, force and moments out.

    A sampled controller: its outputs are those of the beginning of the step, when the
    measurements were taken.
    """

    description = "Saturated output-feedback tracking controller with velocity observer"
    ports = PORTS
    state_type = ControllerState

    def configure(self, values: dict[str, Any]) -> None:
        self._gains = Gains(
            K1=vector(values, "K1", 3),
            K2=vector(values, "K2", 3),
            lambda_=values["lambda"],
            k_d=values["k_d"],
            gamma=values["gamma"],
            sigma=values["sigma"],
            theta_0=vector(values, "theta_0", 4),
            eps_t=values["eps_t"],
            ell=values["ell"],
            s=SATURATIONS[values["saturation"]],
            printed_jacobian=values["printed_jacobian"],
            innovation_gate=values["innovation_gate"],
        )

    def begin(self, inputs: Sequence[float], t: float) -> tuple[ControllerState, list[float]]:
        measurement = _measurement(inputs)
        state = output_feedback.initial_state(self._gains, measurement.y)
        return state, _seen(state, output_feedback.evaluate(self._gains, state, measurement))

    def advance(
        self, state: ControllerState, inputs: Sequence[float], t: float, h: float, n: int
    ) -> tuple[ControllerState, list[float]]:
        measurement = _measurement(inputs)
        credible = output_feedback.gated(self._gains, state, measurement.y)
        if credible is not state:
            self.say(
                f"observer restarted at t = {t:g} s: the measured position moved further than "
                "innovation_gate",
                Fmi2Status.warning,
                key="observer restarted",
            )
        signals = output_feedback.evaluate(self._gains, credible, measurement)
        outputs = _seen(credible, signals)
        state = output_feedback.step(credible, signals, h)
        for _ in range(n - 1):
            signals = output_feedback.evaluate(self._gains, state, measurement)
            state = output_feedback.step(state, signals, h)
        return state, outputs


def _measurement(inputs: Sequence[float]) -> Measurement:
    a, b, c, d, e, f, g, h, i, j, k, l, m, n, o = inputs
    return Measurement((a, b, c), (d, e, f), (g, h, i), (j, k, l), (m, n, o))


def _seen(state: ControllerState, signals: Signals) -> list[float]:
    y_hat, _, theta_hat = state
    return [*signals.tau, *y_hat, *signals.dy_hat, *theta_hat, *signals.e, *signals.z]
