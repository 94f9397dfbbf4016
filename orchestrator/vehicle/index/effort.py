"""Effort of the actuators, (59), and its variation."""

from __future__ import annotations

from math import nan, sqrt
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import LAG, TAU
from auv_fmu.language.vectors import Vector3

#: Units of the root of an energy.
_ROOT = {member: f"{unit}.s^1/2" for member, unit in TAU.items()}


class Inputs(NamedTuple):
    """The applied signal, and the lags of the actuators."""

    applied: Annotated[Vector3, Variable(TAU, "What (3) lets through", name="plant.tau_applied")]
    lag: Annotated[
        Vector3, Variable(LAG, "Time constant; zero: there is no lag", name="plant.actuator.T")
    ] = (0.0, 0.0, 0.0)


class State(NamedTuple):
    """Sums over all steps so far."""

    energy: Vector3  #: integral of the square
    variation: Vector3  #: sum of the absolute differences
    applied: Vector3  #: in the last step
    steps: int


class Outputs(NamedTuple):
    """Efforts and variation."""

    l2_effort: Annotated[
        Vector3,
        Variable(
            _ROOT,
            "root of the integral of the square of the applied signal, the quantity that the "
            "paper prints (reading 6)",
        ),
    ]
    rms_effort: Annotated[Vector3, Variable(TAU, "root mean square of the applied signal (59)")]
    total_variation: Annotated[
        Vector3,
        Variable(TAU, "sum of the absolute differences of the applied signal from step to step"),
    ]


def start() -> State:
    """Begin without a step."""
    none = (0.0, 0.0, 0.0)
    return State(none, none, none, 0)


def update(state: State, inputs: Inputs, acting: Inputs, h: float) -> State:
    """Add a step."""
    lag_u, lag_q, lag_r = inputs.lag
    # Actuators with a lag have a state, so the value at the end of the step counts.
    u = acting.applied[0] if lag_u == 0.0 else inputs.applied[0]
    q = acting.applied[1] if lag_q == 0.0 else inputs.applied[1]
    r = acting.applied[2] if lag_r == 0.0 else inputs.applied[2]
    e_u, e_q, e_r = state.energy
    energy = (e_u + u * u * h, e_q + q * q * h, e_r + r * r * h)
    variation = state.variation
    # Before the first step nothing was applied.
    if state.steps > 0:
        v_u, v_q, v_r = variation
        b_u, b_q, b_r = state.applied
        variation = (v_u + abs(u - b_u), v_q + abs(q - b_q), v_r + abs(r - b_r))
    return State(energy, variation, (u, q, r), state.steps + 1)


def outputs(state: State, t: float, begin: float) -> Outputs:
    """Return the roots of the energy and of its mean, and the variation."""
    if state.steps == 0:
        none = (nan, nan, nan)
        return Outputs(none, none, none)
    u, q, r = state.energy
    length = t - begin
    rms = (sqrt(u / length), sqrt(q / length), sqrt(r / length))
    return Outputs((sqrt(u), sqrt(q), sqrt(r)), rms, state.variation)
