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

from auv_fmu.linear_algebra import Matrix, Vector
from auv_fmu import POSITIVE, Refusal, Variable

COUNT = 5
XY = ("x", "y")
SQUARE = Matrix(((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)))


class Parameters(NamedTuple):
    """The path, and how it is followed."""

    path: Annotated[Matrix, COUNT, 2, Variable("m", "Waypoints, one a row")] = SQUARE
    lookahead: Annotated[float, Variable("m", "Distance to steer for", POSITIVE)] = 2.0
    radius: Annotated[float, Variable("m", "Distance at which a leg ends", 0.0)] = 1.5
    gain: Annotated[float, Variable("1/s", "Gain of the heading", 0.0)] = 2.0
    max_rate: Annotated[float, Variable("rad/s", "Largest rate of the heading", 0.0)] = 1.0


class Inputs(NamedTuple):
    """How fast it drives."""

    speed: Annotated[float, Variable("m/s", "Speed", minimum=0.0)] = 1.0


class State(NamedTuple):
    """Where it is."""

    position: Annotated[Vector, 2, Variable("m", "Position")]
    heading: Annotated[float, Variable("rad", "Heading, anticlockwise from x")]
    waypoint: Annotated[int, Variable("1", "Row of the waypoint that it drives to, from 0")]


class Outputs(NamedTuple):
    """What is seen of it."""

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


def begin(parameters: Parameters) -> tuple[State, Outputs]:
    """State and outputs at the start: at the first waypoint, heading along x."""
    start = parameters.path[0]
    return State(start, 0.0, 1), Outputs(start, 0.0, 0.0, 2, False)


def advance(
    parameters: Parameters, state: State, inputs: Inputs, h: float, n: int
) -> tuple[State, Outputs]:
    """State and outputs after n steps of h seconds with held inputs."""
    position, heading, waypoint, offset = state.position, state.heading, state.waypoint, 0.0
    for _ in range(n):
        if waypoint == COUNT:
            break
        leg = parameters.path[waypoint] - parameters.path[waypoint - 1]
        length, course = sqrt(leg @ leg), atan2(leg[1], leg[0])
        away = position - parameters.path[waypoint - 1]
        offset = (leg[0] * away[1] - leg[1] * away[0]) / length
        turn = course + atan2(-offset, parameters.lookahead) - heading
        rate = parameters.gain * atan2(sin(turn), cos(turn))
        heading += h * min(max(rate, -parameters.max_rate), parameters.max_rate)
        position += h * inputs.speed * Vector((cos(heading), sin(heading)))
        if leg @ away / length >= length - parameters.radius:
            waypoint += 1
    heading = atan2(sin(heading), cos(heading))
    seen = Outputs(position, heading, offset, min(waypoint + 1, COUNT), waypoint == COUNT)
    return State(position, heading, waypoint), seen
