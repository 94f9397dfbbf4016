"""PdController: the baseline that measures the velocity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from auv_fmu import pd
from auv_fmu.pd import PdGains, PdMeasurement, PdSignals
from auv_fmu.types import Vector4
from fmus.pd_controller.ports import PORTS
from fmus.ports.controllers import vector
from fmus.slave.component import Component


class PdState(NamedTuple):
    """The adaptive law is all that has a memory."""

    theta_hat: Vector4


class PdController(Component):
    """(57) and (58), in place of the ObserverController, which knows no velocity.

    A sampled controller: its outputs are those of the beginning of the step, when the
    measurements were taken.
    """

    description = "Adaptive robust PD tracking controller with measured velocity"
    ports = PORTS
    state_type = PdState

    def configure(self, values: dict[str, Any]) -> None:
        self._gains = PdGains(
            K1=vector(values, "K1", 3),
            lambda_=values["lambda"],
            gamma=values["gamma"],
            sigma=values["sigma"],
            theta_0=vector(values, "theta_0", 4),
            eps_t=values["eps_t"],
            ell=values["ell"],
            printed_jacobian=values["printed_jacobian"],
        )

    def begin(self, inputs: Sequence[float], t: float) -> tuple[PdState, list[float]]:
        state = PdState(self._gains.theta_0)
        return state, _seen(state, pd.evaluate(self._gains, state.theta_hat, _measurement(inputs)))

    def advance(
        self, state: PdState, inputs: Sequence[float], t: float, h: float, n: int
    ) -> tuple[PdState, list[float]]:
        measurement = _measurement(inputs)
        (theta_hat,) = state
        signals = pd.evaluate(self._gains, theta_hat, measurement)
        outputs = _seen(state, signals)
        theta_hat = pd.step(theta_hat, signals, h)
        for _ in range(n - 1):
            signals = pd.evaluate(self._gains, theta_hat, measurement)
            theta_hat = pd.step(theta_hat, signals, h)
        return PdState(theta_hat), outputs


def _measurement(inputs: Sequence[float]) -> PdMeasurement:
    a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r = inputs
    return PdMeasurement((a, b, c), (d, e, f), (g, h, i), (j, k, l), (m, n, o), (p, q, r))


def _seen(state: PdState, signals: PdSignals) -> list[float]:
    return [*signals.tau, *state.theta_hat, *signals.e]
