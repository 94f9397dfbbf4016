"""A ball that falls, bounces and comes to rest.

    dh/dt = v,  dv/dt = g

It is stepped by the explicit Euler rule. A step that ends at or below the ground is a bounce: the
ball is put back just above the ground, and its velocity is reversed and reduced by the factor `e`.
A ball that would leave the ground slower than `v_min` stays there. So a bounce is seen at the end
of an internal step, and a smaller `h_max` gives a more exact one.

This is the model BouncingBall of the Reference FMUs of the Modelica Association, with the same
names, values and steps. It gives their published result bit for bit.

Look at `h` and `v`: each bounce reaches about `e` * `e` of the height of the one before, and after
2.6 s the ball rests. With `h_max` = 0.02 s it never does: gravity adds 0.2 m/s in a step, so it
always rebounds faster than `v_min`. Try another `e` during the run.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable

#: The smallest normal number: just above the ground [m].
GROUND = 2.2250738585072014e-308

H_MAX, STEP_SIZE, STOP_TIME = 0.001, 0.01, 3.0


class Parameters(NamedTuple):
    """Ball, and its start."""

    g: Annotated[float, Variable("m/s2", "Gravity acting on the ball", maximum=0.0)] = -9.81
    e: Annotated[
        float, Variable("1", "Coefficient of restitution", minimum=0.5, maximum=1.0, tunable=True)
    ] = 0.7
    v_min: Annotated[
        float, Variable("m/s", "Velocity below which the ball stops bouncing", minimum=0.0)
    ] = 0.1
    h0: Annotated[float, Variable("m", "Height at the start", minimum=0.0)] = 1.0
    v0: Annotated[float, Variable("m/s", "Velocity at the start")] = 0.0


class State(NamedTuple):
    """Motion of the ball."""

    h: float  #: height [m]
    v: float  #: velocity, upwards [m/s]
    rests: bool


class Motion(NamedTuple):
    """Motion between bounces."""

    h: Annotated[float, Variable("m", "Height of the ball")]
    v: Annotated[float, Variable("m/s", "Velocity of the ball, upwards")]


class Margins(NamedTuple):
    """Distance at which the ball bounces."""

    ground: Annotated[float, Variable("m", "From the ground to the ball, unless it rests")]


class Outputs(NamedTuple):
    """Outputs of the ball."""

    h: Annotated[float, Variable("m", "Height of the ball")]
    v: Annotated[float, Variable("m/s", "Velocity of the ball, upwards")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.h0, parameters.v0, False)


def update(parameters: Parameters, state: State, h: float) -> State:
    """State after a step of h seconds, and a bounce if it ends in one."""
    if state.rests:
        return state
    height = state.h + h * state.v
    velocity = state.v + h * parameters.g
    return event(parameters, State(height, velocity, False))


def event(parameters: Parameters, state: State) -> State:
    """The state after a bounce, if the ball falls at or below the ground."""
    if state.rests or state.h > 0 or state.v >= 0:
        return state
    rebound = -state.v * parameters.e
    if rebound < parameters.v_min:
        return State(GROUND, 0.0, True)
    return State(GROUND, rebound, False)


def rates(parameters: Parameters, state: State) -> Motion:
    """Rates of the motion."""
    return Motion(0.0, 0.0) if state.rests else Motion(state.v, parameters.g)


def switches(state: State) -> Margins:
    """Distance from the ground."""
    return Margins(1.0 if state.rests else state.h)


def outputs(state: State) -> Outputs:
    """Outputs of the ball."""
    return Outputs(state.h, state.v)
