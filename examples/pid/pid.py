"""A PID controller whose integral does not wind up.

    u = K (b r - y) + I + D, limited to u_min .. u_max

    dI/dt = K / Ti (r - y) + (u - v) / Tt        v: the value of u before it is limited
    Td / N dD/dt + D = -K Td dy/dt

This is the form of Åström and Wittenmark, Computer-Controlled Systems. `b` weights the set point,
which reduces the overshoot. The derivative acts on the measured value only, through a filter of the
time constant Td / N, and is stepped by the backward rule. It is a sampled controller: `u` belongs
to the current set point and measured value, and is held until the next sample.

While the actuator is at a limit, u - v is not zero, and drives the integral back within about `Tt`
seconds. Otherwise the integral would wind up, and the output would overshoot the set point.

With the default values nothing responds to `u`, so it rises to its limit and `integral` stops
rising. Connect `y` to a plant such as DcMotor or WaterTank.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Refusal, Variable

SAMPLED = True
STOP_TIME = 10.0


class Parameters(NamedTuple):
    """Gain, times and limits."""

    K: Annotated[float, Variable("1", "Gain", tunable=True)] = 2.0
    Ti: Annotated[float, Variable("s", "Integral time", minimum=POSITIVE, tunable=True)] = 1.0
    Td: Annotated[float, Variable("s", "Derivative time", minimum=0.0, tunable=True)] = 0.1
    Tt: Annotated[float, Variable("s", "Tracking time", minimum=POSITIVE, tunable=True)] = 0.5
    N: Annotated[float, Variable("1", "Largest gain of the derivative", 1.0, tunable=True)] = 10.0
    b: Annotated[float, Variable("1", "Weight of the set point", 0.0, 1.0, tunable=True)] = 1.0
    u_min: Annotated[float, Variable("1", "Lower limit of the output", tunable=True)] = -5.0
    u_max: Annotated[float, Variable("1", "Upper limit of the output", tunable=True)] = 5.0


class Inputs(NamedTuple):
    """Set point and measurement."""

    r: Annotated[float, Variable("1", "Set point")] = 1.0
    y: Annotated[float, Variable("1", "Measured value")] = 0.0


class State(NamedTuple):
    """Memory of the controller."""

    integral: float
    derivative: float  #: derivative part of the last sample
    y: float  #: measured value of the last sample
    share: float  #: part of the derivative that remains after the time since then


class Outputs(NamedTuple):
    """Outputs of the controller."""

    u: Annotated[float, Variable("1", "Output to the actuator")]
    integral: Annotated[float, Variable("1", "Integral part")]
    derivative: Annotated[float, Variable("1", "Derivative part")]


def check(parameters: Parameters) -> None:
    """Refuse limits that leave nothing between them."""
    if not parameters.u_min < parameters.u_max:
        raise Refusal(f"u_min = {parameters.u_min:g} must be below u_max = {parameters.u_max:g}")


def start(inputs: Inputs) -> State:
    """State at the start: the measured value has always been constant."""
    return State(0.0, 0.0, inputs.y, 0.0)


def derive(parameters: Parameters, state: State, inputs: Inputs) -> tuple[float, float, float]:
    """The derivative part, and the output before and after its limits."""
    K, N = parameters.K, parameters.N
    derivative = state.share * (state.derivative - K * N * (inputs.y - state.y))
    v = K * (parameters.b * inputs.r - inputs.y) + state.integral + derivative
    return derivative, v, min(max(v, parameters.u_min), parameters.u_max)


def update(
    parameters: Parameters,
    state: State,
    derived: tuple[float, float, float],
    inputs: Inputs,
    h: float,
) -> State:
    """State for the next sample, h seconds later."""
    derivative, v, u = derived
    rate = parameters.K / parameters.Ti * (inputs.r - inputs.y) + (u - v) / parameters.Tt
    share = parameters.Td / (parameters.Td + parameters.N * h)
    return State(state.integral + h * rate, derivative, inputs.y, share)


def outputs(state: State, derived: tuple[float, float, float]) -> Outputs:
    """Outputs of the controller."""
    return Outputs(derived[2], state.integral, derived[0])
