"""The sea at a vehicle: waves and a current, without interaction."""

from __future__ import annotations

from math import pi
from typing import Annotated, NamedTuple

from auv_fmu.language.quantities import ACCELERATION, VELOCITY
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, add, add_scaled
from auv_fmu.water import ocean_current, waves
from auv_fmu.water.ocean_current import Current, Variation
from auv_fmu.water.waves import Components, Spectrum, Waves


class ImpossibleSea(ArithmeticError):
    """Such waves do not exist."""


class Sea(NamedTuple):
    """All parameters of a sea."""

    waves: Waves = Waves()
    current: Current = Current()
    depth: Annotated[float, Variable("m", "Depth of the water; 0: deep", 0.0)] = 50.0
    g: Annotated[float, Variable("m/s2", "Acceleration of gravity (g)", POSITIVE)] = 9.81


class WaterMotion(NamedTuple):
    """Motion of the water at a place."""

    velocity: Annotated[
        Vector3, Variable(VELOCITY, "Velocity of the water in the earth frame", name="water")
    ]
    acceleration: Annotated[
        Vector3,
        Variable(ACCELERATION, "Acceleration of the water in the earth frame", name="dwater"),
    ]
    elevation: Annotated[
        float,
        Variable(
            "m",
            "Elevation of the surface above still water",
            feedthrough=("eta.x", "eta.y", "time"),
        ),
    ]


def check(sea: Sea) -> None:
    """Refuse waves that would break.

    Args:
        sea: parameters.

    Raises:
        ImpossibleSea: regular waves of their height and period do not exist.

    """
    limit = waves.highest_regular(2.0 * pi / sea.waves.Tp, sea.depth, sea.g)
    if sea.waves.spectrum != Spectrum.NONE and sea.waves.Hs > limit:
        raise ImpossibleSea(
            f"waves.Hs = {sea.waves.Hs:g} m is more than {limit:.3g} m, at which waves with "
            f"waves.Tp = {sea.waves.Tp:g} s break in this depth; reduce waves.Hs or raise waves.Tp"
        )


def regular_waves(sea: Sea) -> Components:
    """Regular waves whose sum is the sea.

    Args:
        sea: parameters.

    """
    return waves.components(sea.waves, sea.depth, sea.g)


def water(
    sea: Sea, components: Components, variation: Variation, position: Vector3, t: float
) -> WaterMotion:
    """Motion of the water at a place.

    The acceleration is the material derivative du/dt + (u . grad) u, with the velocity u of waves
    and current; only the change of the current in time is neglected.

    Args:
        sea: parameters.
        components: regular waves for these parameters.
        variation: of the current.
        position: (x, y, z) [m], earth frame, z down from the surface of still water.
        t: time [s].

    """
    moved = waves.motion(sea.waves, components, sea.depth, position, t)
    current, depth = sea.current, sea.depth
    z = waves.clamped(position[2], depth)
    share = ocean_current.profile(current.root, z, depth)
    velocity = add(moved.velocity, ocean_current.velocity(current, variation, share))
    u, v, w = velocity
    # Above still water the motion is the same as at its surface.
    rise = w if position[2] >= 0.0 else 0.0
    shear = ocean_current.velocity(current, variation, ocean_current.slope(current.root, z, depth))
    convective = add_scaled(waves.along(moved.gradient, (u, v, rise)), rise, shear)
    return WaterMotion(velocity, add(moved.acceleration, convective), moved.elevation)
