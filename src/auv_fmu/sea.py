"""The sea at a vehicle: waves and a current, neither of which changes the other."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from auv_fmu import ocean_current, waves
from auv_fmu.ocean_current import Current, Variation
from auv_fmu.vectors import Vector3, total
from auv_fmu.waves import Components, WaterMotion, Waves


class ImpossibleSea(ArithmeticError):
    """There are no such waves."""


class Sea(NamedTuple):
    """All parameters of a sea."""

    waves: Waves = Waves()
    current: Current = Current()
    depth: float = 50.0  #: of the water [m]; 0: deeper than waves reach
    g: float = 9.81  #: acceleration of gravity [m/s2]


def check(sea: Sea) -> None:
    """Refuse waves that would break.

    Args:
        sea: parameters.

    Raises:
        ImpossibleSea: regular waves of their height and period do not exist.

    """
    limit = waves.highest_regular(2.0 * pi / sea.waves.Tp, sea.depth, sea.g)
    if sea.waves.spectrum != waves.NONE and sea.waves.Hs > limit:
        raise ImpossibleSea(
            f"waves.Hs = {sea.waves.Hs:g} m is more than {limit:.3g} m, at which waves with "
            f"waves.Tp = {sea.waves.Tp:g} s break in this depth; reduce waves.Hs or raise waves.Tp"
        )


def regular_waves(sea: Sea) -> Components:
    """The waves that the sea is a sum of.

    Args:
        sea: parameters.

    """
    return waves.components(sea.waves, sea.depth, sea.g)


def water(
    sea: Sea, components: Components, variation: Variation, position: Vector3, t: float
) -> WaterMotion:
    """How the water moves at a place.

    The acceleration is that of the waves: the current changes slowly.

    Args:
        sea: parameters.
        components: the waves that belong to them.
        variation: of the current.
        position: (x, y, z) [m], earth frame, z down from the surface of still water.
        t: time [s].

    """
    moved, acceleration, elevation = waves.motion(sea.waves, components, sea.depth, position, t)
    z = waves.within(position[2], sea.depth)
    carried = ocean_current.velocity(sea.current, variation, z, sea.depth)
    return WaterMotion(total(moved, carried), acceleration, elevation)
