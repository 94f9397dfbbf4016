"""A mobile robot that drives through waypoints, such as one that mows a lawn.

    heading_d = course + atan2(-offset, lookahead)
    rate      = gain (heading_d - heading), limited to max_rate

On each leg from one waypoint to the next the robot steers for a point on the line, `lookahead`
metres ahead of it. `offset` is how far it is to the left of the line, and dies out like
exp(-distance / lookahead) where it is small. This is known as line-of-sight guidance. A leg ends
`radius` metres before its waypoint, and the last waypoint ends the drive.

A shorter `lookahead` leads back to the line sooner, and begins to swing where the robot turns too
slowly for it. With the default values the robot drives around a square of 20 m. Plot `position.y`
over `position.x`, and look at `offset` and `waypoint`.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Refusal, Variable, Vector

COUNT = 5
XY = ("x", "y")
SQUARE = Matrix(((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)))

H_MAX, STEP_SIZE, STOP_TIME = 0.02, 0.1, 100.0


class Parameters(NamedTuple):
    """Path and guidance."""

    path: Annotated[Matrix, COUNT, 2, Variable("m", "Waypoints, one a row")] = SQUARE
    lookahead: Annotated[float, Variable("m", "Distance to steer for", POSITIVE)] = 2.0
    radius: Annotated[float, Variable("m", "Distance at which a leg ends", 0.0)] = 1.5
    gain: Annotated[float, Variable("1/s", "Gain of the heading", 0.0)] = 2.0
    max_rate: Annotated[float, Variable("rad/s", "Largest rate of the heading", 0.0)] = 1.0


class Inputs(NamedTuple):
    """Speed."""

    speed: Annotated[float, Variable("m/s", "Speed", minimum=0.0)] = 1.0


class State(NamedTuple):
    """Position, heading and waypoint."""

    position: Annotated[Vector, 2]  #: [m]
    heading: float  #: anticlockwise from x [rad]
    waypoint: int  #: row of the waypoint that it drives to, from 0


class Outputs(NamedTuple):
    """Outputs of the robot."""

    position: Annotated[Vector, 2, Variable("m", "Position", members=XY)]
    heading: Annotated[float, Variable("rad", "Heading, anticlockwise from x")]
    offset: Annotated[float, Variable("m", "Offset to the left of the line")]
    waypoint: Annotated[int, Variable("1", "Number of the waypoint that it drives to, from 1")]
    arrived: Annotated[bool, Variable("1", "It has reached the last waypoint")]


def check(parameters: Parameters) -> None:
    """Refuse a path that stays at a waypoint, where there is no course."""
    for k in range(COUNT - 1):
        leg = parameters.path[k + 1] - parameters.path[k]
        if leg @ leg == 0:
            raise Refusal(f"waypoints {k + 1} and {k + 2} are the same")


def start(parameters: Parameters) -> State:
    """State at the start: at the first waypoint, heading along x."""
    return State(parameters.path[0], 0.0, 1)


def derive(parameters: Parameters, state: State) -> tuple[float, float, float]:
    """The course of its leg [rad], its offset from it, and how much of it is left [m]."""
    k = min(state.waypoint, COUNT - 1)
    leg, away = parameters.path[k] - parameters.path[k - 1], state.position - parameters.path[k - 1]
    length, offset = sqrt(leg @ leg), leg[0] * away[1] - leg[1] * away[0]
    return atan2(leg[1], leg[0]), offset / length, length - leg @ away / length


def update(
    parameters: Parameters,
    state: State,
    derived: tuple[float, float, float],
    inputs: Inputs,
    h: float,
) -> State:
    """State after a step of h seconds with a held speed."""
    if state.waypoint == COUNT:
        return state
    course, offset, left = derived
    turn = course + atan2(-offset, parameters.lookahead) - state.heading
    rate = parameters.gain * atan2(sin(turn), cos(turn))
    heading = state.heading + h * min(max(rate, -parameters.max_rate), parameters.max_rate)
    x, y = cos(heading), sin(heading)
    waypoint = state.waypoint + int(left <= parameters.radius)
    return State(state.position + h * inputs.speed * Vector((x, y)), atan2(y, x), waypoint)


def outputs(state: State, derived: tuple[float, float, float]) -> Outputs:
    """Outputs of the robot."""
    number, arrived = min(state.waypoint + 1, COUNT), state.waypoint == COUNT
    return Outputs(state.position, state.heading, derived[1], number, arrived)
