"""A complementary filter that finds an angle from a gyroscope and an accelerometer.

    T d(angle)/dt = T gyro + (atan2(-a_x, a_z) - angle)

A gyroscope measures fast motion well, but the integral of its bias drifts. An accelerometer shows
the direction of gravity, but also every acceleration of the vehicle. The filter takes changes that
are faster than `T` seconds from the first and slower ones from the second: its two transfer
functions, T s / (T s + 1) and 1 / (T s + 1), add up to one. See W. T. Higgins, A comparison of
complementary and Kalman filtering, 1975.

It is a continuous filter, solved exactly for held inputs. The difference of both angles is taken
around the circle, so that the filter may turn over.

With the default values the sensor lies still, and its gyroscope has a bias of 0.02 rad/s. `angle`
ends at T times the bias; `gyro_angle`, the integral, drifts away. Look at both.
"""

from __future__ import annotations

from math import atan2, cos, exp, sin
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable

STOP_TIME = 10.0


class Parameters(NamedTuple):
    """Time constant and start."""

    T: Annotated[float, Variable("s", "Time constant", minimum=POSITIVE, tunable=True)] = 2.0
    angle0: Annotated[float, Variable("rad", "Angle at the start")] = 0.0


class Inputs(NamedTuple):
    """Measurements in the axes of the sensor."""

    gyro: Annotated[float, Variable("rad/s", "Rate of the angle")] = 0.02
    a_x: Annotated[float, Variable("m/s2", "Specific force, forwards")] = 0.0
    a_z: Annotated[float, Variable("m/s2", "Specific force, upwards")] = 9.81


class State(NamedTuple):
    """Both estimates of the angle."""

    angle: float  #: [rad]
    gyro_angle: float  #: [rad]


class Outputs(NamedTuple):
    """Outputs of the filter."""

    angle: Annotated[float, Variable("rad", "Angle")]
    gyro_angle: Annotated[float, Variable("rad", "Angle from the gyroscope only")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.angle0, parameters.angle0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with held inputs."""
    leaning = atan2(-inputs.a_x, inputs.a_z)
    difference = leaning - state.angle
    short_way = atan2(sin(difference), cos(difference))
    # Final value of the filter, relative to its angle now.
    target = short_way + parameters.T * inputs.gyro
    return State(
        state.angle + target * (1.0 - exp(-h / parameters.T)),
        state.gyro_angle + h * inputs.gyro,
    )


def outputs(state: State) -> Outputs:
    """Outputs of the filter."""
    return Outputs(state.angle, state.gyro_angle)
