"""The six tasks: the reference of the control point, the water, and losses of the position.

=============  ==================================================================================
`helix`        a circle of a radius, at the speed of the vehicle, that sinks
`step`         straight ahead at a speed, which is zero for vehicles that can hover, from a start
               that is some metres away
`path`         waypoints in a zigzag, whose corners are rounded
`current`      the helix in a current
`sea`          the path, in a current and below waves
`sensor_loss`  the helix, while the position is lost for some seconds
=============  ==================================================================================

All references begin at the same point, except in the step, and at the speed of the vehicle towards
north. In tasks without a current the water moves at a share of its velocity.
"""

from __future__ import annotations

from enum import IntEnum
from math import cos, sin
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector
from auv_fmu.guidance.path_planner import (
    Waypoints,
    corner_ahead,
    first_corner,
    reference,
)
from auv_fmu.paper.motion_planner import Reference
from auv_fmu.water import waves
from auv_fmu.water.waves import Components, Waves

STEP_SIZE, STOP_TIME = 0.02, 40.0

XYZ = ("x", "y", "z")

#: Waypoints of the path, and zeros for those that are not used.
COUNT = 6
UNUSED = (0.0,) * 26


class Task(IntEnum):
    """Tasks."""

    HELIX = 0
    STEP = 1
    PATH = 2
    CURRENT = 3
    SEA = 4
    SENSOR_LOSS = 5


class Parameters(NamedTuple):
    """The task, what the vehicle can do, and disturbances."""

    task: Annotated[Task, Variable("1", "The task")] = Task.HELIX
    speed: Annotated[float, Variable("m/s", "Speed of helix and path", POSITIVE)] = 0.5
    depth: Annotated[float, Variable("m", "Depth of the start")] = 3.0
    radius: Annotated[
        float, Variable("m", "Radius of the helix", POSITIVE, name="helix.radius")
    ] = 3.0
    sinking: Annotated[
        float, Variable("m/s", "Sinking speed of the helix", name="helix.sinking")
    ] = 0.05
    step_speed: Annotated[float, Variable("m/s", "Speed of the step", 0.0, name="step.speed")] = 0.0
    offset: Annotated[
        Vector, 3, Variable("m", "Offset of the step", members=XYZ, name="step.offset")
    ] = Vector((2.0, 1.0, 1.0))
    leg: Annotated[
        float, Variable("m", "Length of a leg of the path", POSITIVE, name="path.leg")
    ] = 6.0
    turn: Annotated[float, Variable("rad", "Turn at a corner of the path", name="path.turn")] = 1.2
    dive: Annotated[
        float, Variable("m", "Change of depth on each second leg", name="path.dive")
    ] = 1.0
    rounding: Annotated[
        float, Variable("s", "Duration of the rounding of a corner", POSITIVE, name="path.rounding")
    ] = 6.0
    current: Annotated[Vector, 3, Variable("m/s", "Current", members=XYZ)] = Vector((0.1, 0.0, 0.0))
    calm: Annotated[float, Variable("1", "Share of the current in tasks without one", 0.0, 1.0)] = (
        0.2
    )
    waves: Waves = Waves()
    begin: Annotated[float, Variable("s", "Begin of the loss", 0.0, name="loss.begin")] = 22.0
    duration: Annotated[float, Variable("s", "Duration of the loss", 0.0, name="loss.duration")] = (
        3.0
    )


class Inputs(NamedTuple):
    """Position of the vehicle."""

    eta: Annotated[Vector, 3, Variable("m", "Position of the vehicle", members=XYZ)]


class Derived(NamedTuple):
    """Path and waves."""

    waypoints: Waypoints
    components: Components


class Outputs(NamedTuple):
    """The reference, the water, and the loss."""

    reference: Annotated[Reference, Variable(name="")]
    water: Annotated[
        Vector, 3, Variable("m/s", "Velocity of the water in the earth frame", members=XYZ)
    ]
    dwater: Annotated[
        Vector, 3, Variable("m/s2", "Acceleration of the water in the earth frame", members=XYZ)
    ]
    lost: Annotated[float, Variable("1", "1 while the position is lost, else 0")]


def zigzag(parameters: Parameters) -> Waypoints:
    """Waypoints of the path; it passes the start of the task when its first rounding is over."""
    leg, turn, depth = parameters.leg, parameters.turn, parameters.depth
    dive = parameters.dive
    ahead, side = leg * cos(turn), leg * sin(turn)
    x = -0.5 * parameters.rounding * parameters.speed
    return Waypoints(
        COUNT,
        (
            x,
            x + leg,
            x + leg + ahead,
            x + 2.0 * leg + ahead,
            x + 2.0 * (leg + ahead),
            x + 3.0 * leg + 2.0 * ahead,
            *UNUSED,
        ),
        (0.0, 0.0, side, side, 2.0 * side, 2.0 * side, *UNUSED),
        (depth, depth, depth + dive, depth + dive, depth, depth, *UNUSED),
        (0.0,) * 32,
        False,
        parameters.speed,
        parameters.rounding,
    )


def derive(parameters: Parameters) -> Derived:
    """The path and the waves."""
    sea = parameters.waves
    if parameters.task != Task.SEA:
        sea = sea._replace(spectrum=waves.Spectrum.NONE)
    return Derived(zigzag(parameters), waves.components(sea, 0.0, 9.81))


def wanted(parameters: Parameters, waypoints: Waypoints, t: float) -> Reference:
    """The reference of the task at time t [s]."""
    task, speed, depth = parameters.task, parameters.speed, parameters.depth
    if task == Task.STEP:
        x, y, z = parameters.offset
        along = parameters.step_speed
        return Reference((x + along * t, y, depth + z), (along, 0.0, 0.0), (0.0, 0.0, 0.0))
    if task == Task.PATH or task == Task.SEA:  # noqa: PLR1714
        since = t + waypoints.rounding
        corner = corner_ahead(waypoints, first_corner(waypoints, 0.0), since)
        return reference(waypoints, corner, since)
    radius, sinking = parameters.radius, parameters.sinking
    rate = speed / radius
    s, c = sin(rate * t), cos(rate * t)
    return Reference(
        (radius * s, radius * (1.0 - c), depth + sinking * t),
        (speed * c, speed * s, sinking),
        (-speed * rate * s, speed * rate * c, 0.0),
    )


def outputs(parameters: Parameters, derived: Derived, inputs: Inputs, t: float) -> Outputs:
    """The reference, the water at the vehicle, and the loss."""
    task = parameters.task
    flows = task == Task.CURRENT or task == Task.SEA  # noqa: PLR1714
    water = parameters.current if flows else parameters.calm * parameters.current
    dwater = Vector((0.0, 0.0, 0.0))
    if task == Task.SEA:
        x, y, z = inputs.eta
        moved = waves.motion(parameters.waves, derived.components, 0.0, (x, y, z), t)
        u, v, w = moved.velocity
        water = water + Vector((u, v, w))
        a, b, c = moved.acceleration
        d, e, f = waves.along(moved.gradient, (water[0], water[1], water[2]))
        dwater = Vector((a + d, b + e, c + f))
    lost = task == Task.SENSOR_LOSS and 0.0 <= t - parameters.begin < parameters.duration
    return Outputs(wanted(parameters, derived.waypoints, t), water, dwater, 1.0 if lost else 0.0)
