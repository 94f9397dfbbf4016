"""The sensors between a vehicle and a law: noise, and losses.

Position, velocity and attitude have independent white noise at each step. While the position is
lost, its sensor holds the last value, without noise. The velocity may be lost at the same time.
"""

from __future__ import annotations

from math import radians
from typing import Annotated, NamedTuple

from auv_fmu import Variable, Vector

XYZ = ("x", "y", "z")
ANGLES = ("phi", "theta", "psi")

SAMPLED, STEP_SIZE = True, 0.02


class Parameters(NamedTuple):
    """Standard deviations, and what is lost."""

    position: Annotated[float, Variable("m", "Noise of the position", 0.0, name="position.std")] = (
        0.01
    )
    velocity: Annotated[
        float, Variable("m/s", "Noise of the velocity", 0.0, name="velocity.std")
    ] = 0.01
    attitude: Annotated[
        float, Variable("rad", "Noise of roll and pitch", 0.0, name="attitude.std")
    ] = radians(0.1)
    heading: Annotated[float, Variable("rad", "Noise of the heading", 0.0, name="heading.std")] = (
        radians(0.3)
    )
    velocity_lost: Annotated[
        int, Variable("1", "1: the velocity is lost with the position; 0: it is not", 0, 1)
    ] = 0
    seed: Annotated[int, Variable("1", "Seed of the noise", name="noise.seed")] = 1


class Inputs(NamedTuple):
    """True motion of the vehicle."""

    true_y: Annotated[Vector, 3, Variable("m", "Control point", members=XYZ)]
    true_dy: Annotated[Vector, 3, Variable("m/s", "Velocity of the control point", members=XYZ)]
    true_eta: Annotated[Vector, 3, Variable("rad", "Euler angle", members=ANGLES)]
    lost: Annotated[float, Variable("1", "1 while the position is lost, else 0")]


class Seen(NamedTuple):
    """Measured values."""

    y: Annotated[Vector, 3, Variable("m", "Measured control point", members=XYZ)]
    dy: Annotated[Vector, 3, Variable("m/s", "Measured velocity of it", members=XYZ)]
    eta: Annotated[Vector, 3, Variable("rad", "Measured Euler angle", members=ANGLES)]
    y_there: Annotated[float, Variable("1", "1 while the position is measured, else 0")]
    dy_there: Annotated[float, Variable("1", "1 while the velocity is measured, else 0")]


class State(NamedTuple):
    """Last values that were measured."""

    y: Annotated[Vector, 3]  #: [m]
    dy: Annotated[Vector, 3]  #: [m/s]


class Outputs(NamedTuple):
    """Outputs of the sensors."""

    seen: Annotated[Seen, Variable(name="")]


def start(inputs: Inputs) -> State:
    """State at the start."""
    return State(inputs.true_y, inputs.true_dy)


def update(parameters: Parameters, state: State, inputs: Inputs) -> State:
    """State after a step: the last values that were measured."""
    if inputs.lost == 0.0:
        return State(inputs.true_y, inputs.true_dy)
    return State(state.y, state.dy if parameters.velocity_lost == 1 else inputs.true_dy)


def outputs(parameters: Parameters, state: State, inputs: Inputs) -> Outputs:
    """Values without noise."""
    y_there = 1.0 - inputs.lost
    dy_there = 1.0 - inputs.lost * parameters.velocity_lost
    return Outputs(
        Seen(
            inputs.true_y if y_there == 1.0 else state.y,
            inputs.true_dy if dy_there == 1.0 else state.dy,
            inputs.true_eta,
            y_there,
            dy_there,
        )
    )


def seed(parameters: Parameters) -> int:
    """Seed of the noise."""
    return parameters.seed


def measured(parameters: Parameters, seen: Seen, n: Annotated[Vector, 9]) -> Seen:
    """Values with noise."""
    y = parameters.position * seen.y_there
    dy = parameters.velocity * seen.dy_there
    tilt = parameters.attitude
    noise = Vector((tilt * n[6], tilt * n[7], parameters.heading * n[8]))
    return seen._replace(
        y=seen.y + y * Vector(n[0:3]), dy=seen.dy + dy * Vector(n[3:6]), eta=seen.eta + noise
    )
