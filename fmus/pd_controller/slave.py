"""PdController: the baseline that measures the velocity."""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu import pd
from auv_fmu.pd import PdGains, PdMeasurement, PdSignals
from auv_fmu.types import Vector3, Vector4
from fmus.pd_controller.ports import PARAMETERS, PORTS
from fmus.ports.controllers import GROUP_OF
from fmus.slave.component import Component


class PdState(NamedTuple):
    """The adaptive law is all that has a memory."""

    theta_hat: Vector4


class Outputs(TypedDict):
    """The command, and what the controller knows."""

    tau: Vector3
    theta_hat: Vector4
    e: Vector3


class PdController(Component[PdState, PdMeasurement, Outputs, PdGains]):
    """(57) and (58), in place of the ObserverController, which knows no velocity.

    A sampled controller: its outputs are those of the beginning of the step, when the
    measurements were taken.
    """

    description = "Adaptive robust PD tracking controller with measured velocity"
    ports = PORTS
    parameter_set = PARAMETERS
    group_of = GROUP_OF

    def begin(self, inputs: PdMeasurement, t: float) -> tuple[PdState, Outputs]:
        theta_hat = self.parameters.theta_0
        signals = pd.evaluate(self.parameters, theta_hat, inputs)
        return PdState(theta_hat), _seen(theta_hat, signals)

    def advance(
        self, state: PdState, inputs: PdMeasurement, t: float, h: float, n: int
    ) -> tuple[PdState, Outputs]:
        (theta_hat,) = state
        signals = pd.evaluate(self.parameters, theta_hat, inputs)
        outputs = _seen(theta_hat, signals)
        theta_hat = pd.step(theta_hat, signals, h)
        while n > 1:
            signals = pd.evaluate(self.parameters, theta_hat, inputs)
            theta_hat = pd.step(theta_hat, signals, h)
            n -= 1
        return PdState(theta_hat), outputs


def _seen(theta_hat: Vector4, signals: PdSignals) -> Outputs:
    return {"tau": signals.tau, "theta_hat": theta_hat, "e": signals.e}
