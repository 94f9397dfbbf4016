"""How PdController runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`.

A sampled controller: its outputs belong to the beginning of the step, when the measurements
were taken.
"""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu import pd
from auv_fmu.pd import PdGains, PdMeasurement, PdSignals
from auv_fmu.vectors import Vector3, Vector4


class PdState(NamedTuple):
    """The adaptive law is all that has a memory."""

    theta_hat: Vector4


class Outputs(TypedDict):
    """The command, and what the controller knows."""

    tau: Vector3
    theta_hat: Vector4
    e: Vector3


def begin(parameters: PdGains, inputs: PdMeasurement) -> tuple[PdState, Outputs]:
    """State and outputs at the start."""
    theta_hat = parameters.theta_0
    return PdState(theta_hat), _seen(theta_hat, pd.evaluate(parameters, theta_hat, inputs))


def advance(
    parameters: PdGains, state: PdState, inputs: PdMeasurement, h: float, n: int
) -> tuple[PdState, Outputs]:
    """State after n steps of h seconds, and outputs at the beginning of the first."""
    theta_hat = state.theta_hat
    signals = pd.evaluate(parameters, theta_hat, inputs)
    after = pd.steps(parameters, theta_hat, signals, inputs, h, n)
    return PdState(after), _seen(theta_hat, signals)


def _seen(theta_hat: Vector4, signals: PdSignals) -> Outputs:
    return {"tau": signals.tau, "theta_hat": theta_hat, "e": signals.e}
