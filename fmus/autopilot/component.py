"""Autopilots of speed, depth or pitch, and heading."""

from __future__ import annotations

from auv_fmu import __author__, __license__, __version__
from auv_fmu.guidance import autopilot
from auv_fmu.guidance.autopilot import Inputs, Outputs, Parameters, Signals, State
from auv_fmu.paper.euler import STEP

SAMPLED = True

H_MAX = STEP


def start() -> State:
    """Return the state at the start."""
    return State(0.0, 0.0, 0.0, 0.0)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> Signals:
    """Return the command, and the rates of the integrals."""
    return autopilot.evaluate(parameters, state, inputs)


def update(state: State, derived: Signals, h: float) -> State:
    """Return the state after a step."""
    return autopilot.step(state, derived.rates, h)


def outputs(derived: Signals) -> Outputs:
    """Return the command, and the pitch that is held."""
    return Outputs(derived.tau, derived.theta_c)
