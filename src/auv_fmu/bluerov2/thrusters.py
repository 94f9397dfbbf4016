"""The eight thrusters of the BlueROV2 Heavy: their thrust, and where they push.

The curve is a fit to what Blue Robotics measured of a T200 at 16 V and at rest ("T200 Public
Performance Data 10-20 V", September 2019): of 201 points the largest error is 1.9 N, at full
command, and the root of the mean square 0.34 N. Positions and directions are from von Benzon et al.
(2022), doi:10.3390/jmse10121898. Not in the paper.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Annotated, NamedTuple

from auv_fmu import __citation__ as of_the_paper
from auv_fmu.language.arrays import Vector
from auv_fmu.language.variable import POSITIVE, Refusal, Variable
from auv_fmu.language.vectors import Vector6
from auv_fmu.paper.actuators import limit

#: Source of the model, and the paper of the equation numbers.
__citation__ = (
    "The model is from M. von Benzon et al., An Open-Source Benchmark Simulator: Control of a "
    f"BlueROV2 Underwater Robot, JMSE 10(12):1898, 2022. {of_the_paper}"
)

#: Number of thrusters.
COUNT = 8

#: Largest difference of a direction's length from one.
_ROUNDING = 1e-3

#: Cosine of 45 degrees: the horizontal thrusters are turned by it.
_DIAGONAL = round(sqrt(0.5), 12)


class Curve(NamedTuple):
    """Thrust of a T200 at 16 V; a command of -1 .. 1 is a pulse of 1100 .. 1900 us."""

    dead_band: Annotated[
        float,
        Variable("1", "Size of a command without thrust", 0.0, 0.9, name="curve.dead_band"),
    ] = 0.07
    forward: Annotated[
        float,
        Variable(
            "N",
            "Thrust ahead per command beyond the dead band",
            POSITIVE,
            name="curve.forward.linear",
        ),
    ] = 28.2
    forward_square: Annotated[
        float,
        Variable(
            "N",
            "Thrust ahead per square of the command beyond the dead band",
            0.0,
            name="curve.forward.square",
        ),
    ] = 31.3
    reverse: Annotated[
        float,
        Variable(
            "N",
            "Thrust astern per command beyond the dead band",
            POSITIVE,
            name="curve.reverse.linear",
        ),
    ] = 22.9
    reverse_square: Annotated[
        float,
        Variable(
            "N",
            "Thrust astern per square of the command beyond the dead band",
            0.0,
            name="curve.reverse.square",
        ),
    ] = 23.4


class Layout(NamedTuple):
    """Positions and directions of the thrusters, the first four horizontal, the others vertical."""

    x: Annotated[
        Annotated[Vector, COUNT],
        Variable("m", "Thruster ahead of the centre of mass", name="thruster[{}].x"),
    ] = Vector((0.156, 0.156, -0.156, -0.156, 0.12, 0.12, -0.12, -0.12))
    y: Annotated[
        Annotated[Vector, COUNT],
        Variable("m", "Thruster to starboard of the centre of mass", name="thruster[{}].y"),
    ] = Vector((0.111, -0.111, 0.111, -0.111, 0.218, -0.218, 0.218, -0.218))
    z: Annotated[
        Annotated[Vector, COUNT],
        Variable("m", "Thruster below the centre of mass", name="thruster[{}].z"),
    ] = Vector((0.085, 0.085, 0.085, 0.085, 0.0, 0.0, 0.0, 0.0))
    e_x: Annotated[
        Annotated[Vector, COUNT],
        Variable("1", "Direction of a positive thrust, ahead", name="thruster[{}].e_x"),
    ] = Vector((_DIAGONAL, _DIAGONAL, -_DIAGONAL, -_DIAGONAL, 0.0, 0.0, 0.0, 0.0))
    e_y: Annotated[
        Annotated[Vector, COUNT],
        Variable("1", "Direction of a positive thrust, to starboard", name="thruster[{}].e_y"),
    ] = Vector((-_DIAGONAL, _DIAGONAL, -_DIAGONAL, _DIAGONAL, 0.0, 0.0, 0.0, 0.0))
    e_z: Annotated[
        Annotated[Vector, COUNT],
        Variable("1", "Direction of a positive thrust, down", name="thruster[{}].e_z"),
    ] = Vector((0.0, 0.0, 0.0, 0.0, -1.0, -1.0, -1.0, -1.0))


def thrust(curve: Curve, command: float) -> float:
    """Steady thrust of a command [N], which is limited to -1 .. 1.

    Args:
        curve: of the thruster.
        command: of the thruster.

    """
    beyond = abs(limit(command, -1.0, 1.0)) - curve.dead_band
    if beyond <= 0.0:
        return 0.0
    if command > 0.0:
        return beyond * (curve.forward + curve.forward_square * beyond)
    return -beyond * (curve.reverse + curve.reverse_square * beyond)


def command_of(curve: Curve, force: float) -> float:
    """Command of a thrust, the inverse of :func:`thrust`; 0 of none.

    Args:
        curve: of the thruster.
        force: thrust [N].

    """
    size = abs(force)
    if size == 0.0:
        return 0.0
    linear = curve.forward if force > 0.0 else curve.reverse
    square = curve.forward_square if force > 0.0 else curve.reverse_square
    beyond = 2.0 * size / (linear + sqrt(linear * linear + 4.0 * square * size))
    return copysign(curve.dead_band + beyond, force)


def forces(layout: Layout, thrusts: Annotated[Vector, COUNT]) -> Vector6:
    """Force and moment of the thrusters about the centre of mass, body frame.

    Args:
        layout: of the thrusters.
        thrusts: of each [N].

    Returns:
        (X, Y, Z, K, M, N) [N, N.m].

    """
    X, Y, Z, K, M, N = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for x, y, z, e_x, e_y, e_z, f in zip(
        layout.x, layout.y, layout.z, layout.e_x, layout.e_y, layout.e_z, thrusts
    ):
        f_x, f_y, f_z = e_x * f, e_y * f, e_z * f
        X, Y, Z = X + f_x, Y + f_y, Z + f_z
        K, M, N = K + (y * f_z - z * f_y), M + (z * f_x - x * f_z), N + (x * f_y - y * f_x)
    return X, Y, Z, K, M, N


def check(layout: Layout) -> None:
    """Refuse directions that are not of length one.

    Raises:
        Refusal: a direction is shorter or longer.

    """
    for k in range(COUNT):
        a, b, c = layout.e_x[k], layout.e_y[k], layout.e_z[k]
        length = sqrt(a * a + b * b + c * c)
        if not abs(length - 1.0) <= _ROUNDING:
            raise Refusal(
                f"the direction of thruster[{k + 1}] (.e_x, .e_y, .e_z) is of length {length:g}, "
                "not 1"
            )
