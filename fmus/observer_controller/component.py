"""Saturated output-feedback tracking controller with velocity observer."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable, __author__, __citation__, __license__, __version__
from auv_fmu.language.quantities import POSITION, TAU, VELOCITY
from auv_fmu.language.vectors import Vector3
from auv_fmu.paper import output_feedback
from auv_fmu.paper.adaptation import Estimate
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.observer import EXACT
from auv_fmu.paper.output_feedback import ControllerState, Gains, Measurement, Signals

SAMPLED = True

H_MAX = STEP

#: Message about a measurement that is not credible, at time t [s].
RESTARTED = (
    "observer restarted at t = {t:g} s: the measured position is further from its estimate than "
    "innovation_gate"
)


class Outputs(NamedTuple):
    """The command, estimates and errors."""

    tau: Annotated[Vector3, Variable(TAU, "Commanded force and moments (21), not limited")]
    y_hat: Annotated[
        Vector3,
        Variable(POSITION, "Estimated control point (y_hat)", feedthrough=("y",), initially=()),
    ]
    dy_hat: Annotated[
        Vector3,
        Variable(
            VELOCITY,
            "Estimated velocity of the control point (23)",
            feedthrough=("y", "y_d", "dy_d"),
            initially=(),
        ),
    ]
    theta_hat: Estimate
    e: Annotated[
        Vector3,
        Variable(POSITION, "Tracking error y - y_d", feedthrough=("y.{}", "y_d.{}"), initially=()),
    ]
    z: Annotated[
        Vector3, Variable(POSITION, "Estimation error y - y_hat", feedthrough=("y",), initially=())
    ]


def start(parameters: Gains, inputs: Measurement) -> ControllerState:
    """Return the state at the start."""
    return output_feedback.initial_state(parameters, inputs.y)


def credible(parameters: Gains, state: ControllerState, inputs: Measurement) -> bool:
    """Return True if the measurement agrees with the state."""
    return output_feedback.credible(parameters, state, inputs.y)


def restarted(parameters: Gains, state: ControllerState, inputs: Measurement) -> ControllerState:
    """Return the state after a restart of the observer."""
    return output_feedback.restarted(parameters, state, inputs.y)


def derive(parameters: Gains, state: ControllerState, inputs: Measurement) -> Signals:
    """Return the signals, for a step as long as the last one."""
    return output_feedback.evaluate(parameters, state, inputs, state.h)


def update(
    parameters: Gains, state: ControllerState, derived: Signals, inputs: Measurement, h: float
) -> ControllerState:
    """Return the state after a step."""
    if parameters.form == EXACT and h != state.h:
        derived = output_feedback.evaluate(parameters, state, inputs, h)
    return output_feedback.step(state, derived, h)


def outputs(state: ControllerState, derived: Signals) -> Outputs:
    """Return the command, estimates and errors."""
    return Outputs(derived.tau, state.y_hat, derived.dy_hat, state.theta_hat, derived.e, derived.z)


def check_state(state: ControllerState) -> None:
    """Refuse a negative last step."""
    if state.h < 0.0:
        raise Refusal("its last step is shorter than zero")
