"""The van der Pol oscillator, whose damping is negative for small deflections.

    dx0/dt = x1
    dx1/dt = mu (1 - x0^2) x1 - x0

B. van der Pol described it in 1926, as an electrical circuit with a vacuum tube. Whatever its start
is, except for the origin, it ends in the same limit cycle. For small `mu` this is nearly a sine of
amplitude 2. For large `mu` it alternates between slow drifts and sudden jumps.

This is the model VanDerPol of the Reference FMUs of the Modelica Association, with the same names,
values and steps. It is stepped by the explicit Euler rule, as theirs is, and gives their published
result bit for bit.

Plot `x1` over `x0` to see the cycle, and try `mu` = 5.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable

H_MAX, STEP_SIZE, STOP_TIME = 0.01, 0.01, 20.0


class Parameters(NamedTuple):
    """Damping and start."""

    mu: Annotated[float, Variable("1", "Strength of the damping", minimum=0.0, tunable=True)] = 1.0
    x0_start: Annotated[float, Variable("1", "Deflection at the start")] = 2.0
    x1_start: Annotated[float, Variable("1/s", "Rate of the deflection at the start")] = 0.0


class State(NamedTuple):
    """Motion of the oscillator."""

    x0: Annotated[float, Variable("1", "Deflection")]
    x1: Annotated[float, Variable("1/s", "Rate of the deflection")]


class Outputs(NamedTuple):
    """Outputs of the oscillator."""

    x0: Annotated[float, Variable("1", "Deflection")]
    x1: Annotated[float, Variable("1/s", "Rate of the deflection")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.x0_start, parameters.x1_start)


def update(parameters: Parameters, state: State, h: float) -> State:
    """State after a step of h seconds."""
    rate = rates(parameters, state)
    return State(state.x0 + h * rate.x0, state.x1 + h * rate.x1)


def rates(parameters: Parameters, state: State) -> State:
    """Rates of the state."""
    x0, x1 = state.x0, state.x1
    return State(x1, parameters.mu * ((1 - x0 * x0) * x1) - x0)


def outputs(state: State) -> Outputs:
    """Outputs of the oscillator."""
    return Outputs(state.x0, state.x1)
