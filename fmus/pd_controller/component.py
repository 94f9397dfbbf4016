"""Adaptive robust PD tracking controller with measured velocity."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __citation__, __license__, __version__
from auv_fmu.language.quantities import POSITION, TAU
from auv_fmu.language.vectors import Vector3, Vector4
from auv_fmu.paper import pd
from auv_fmu.paper.adaptation import Estimate
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.pd import PdGains, PdMeasurement, PdSignals

SAMPLED = True

H_MAX = STEP


class State(NamedTuple):
    """State of the adaptive law."""

    theta_hat: Vector4


class Outputs(NamedTuple):
    """The command, estimates and the error."""

    tau: Annotated[Vector3, Variable(TAU, "Commanded force and moments (57), not limited")]
    theta_hat: Estimate
    e: Annotated[
        Vector3,
        Variable(POSITION, "Tracking error y - y_d", feedthrough=("y.{}", "y_d.{}")),
    ]


def start(parameters: PdGains) -> State:
    """Return the state at the start."""
    return State(parameters.theta_0)


def derive(parameters: PdGains, state: State, inputs: PdMeasurement) -> PdSignals:
    """Return the signals."""
    return pd.evaluate(parameters, state.theta_hat, inputs)


def update(state: State, derived: PdSignals, h: float) -> State:
    """Return the state after a step."""
    return State(pd.step(state.theta_hat, derived, h))


def outputs(state: State, derived: PdSignals) -> Outputs:
    """Return the command, estimates and the error."""
    return Outputs(derived.tau, state.theta_hat, derived.e)
