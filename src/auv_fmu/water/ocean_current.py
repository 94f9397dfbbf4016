"""An ocean current: a mean with a profile over depth, and a part that varies at random.

The mean decreases from the surface to the bottom with a power of the height above the bottom, as
DNV-RP-C205 describes tidal currents, with an exponent of 1/7. The random part is a Gauss-Markov
process in each horizontal direction,

    dv/dt + mu v = w,

with white noise w, as in Fossen (2021) for the speed of a current. Its parameter is the standard
deviation. A step is exact, so steps of any length have the same statistics.
"""

from __future__ import annotations

import math
from math import cos, exp, expm1, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.random_numbers import CURRENT_VARIATION, gaussian, start
from auv_fmu.language.variable import Variable
from auv_fmu.language.vectors import Vector3


class Current(NamedTuple):
    """A current; the defaults are a weak one that hardly varies."""

    speed: Annotated[float, Variable("m/s", "Mean speed at the surface", 0.0, tunable=True)] = 0.1
    direction: Annotated[
        float,
        Variable("rad", "Direction that the current goes to: 0 north, pi/2 east", tunable=True),
    ] = 0.0
    root: Annotated[
        float,
        Variable(
            "1",
            "Profile: the root of the height above the bottom, of this degree; 0: no profile",
            0.0,
        ),
    ] = 7.0
    mu: Annotated[
        float,
        Variable("1/s", "Rate at which the variation is forgotten (mu, Gauss-Markov)", 0.0),
    ] = 0.005
    sigma: Annotated[
        float,
        Variable(
            "m/s",
            "Standard deviation of the variation in each horizontal direction (sigma)",
            0.0,
        ),
    ] = 0.02
    seed: Annotated[int, Variable("1", "Seed of the variation")] = 1


class Variation(NamedTuple):
    """The random part of a current at the surface, with the state of the generator."""

    north: float  #: [m/s]
    east: float  #: [m/s]
    random: float  #: state of the generator


def begin(current: Current) -> Variation:
    """Variation at the start, drawn from its stationary distribution.

    Args:
        current: parameters.

    """
    state, north = gaussian(start(current.seed, CURRENT_VARIATION))
    state, east = gaussian(state)
    return Variation(current.sigma * north, current.sigma * east, state)


def advance(current: Current, variation: Variation, h: float) -> Variation:
    """Variation h seconds later.

    Args:
        current: parameters.
        variation: before.
        h: time [s].

    """
    kept = exp(-current.mu * h)
    added = current.sigma * sqrt(-expm1(-2.0 * current.mu * h))
    state, north = gaussian(variation.random)
    state, east = gaussian(state)
    return Variation(
        kept * variation.north + added * north, kept * variation.east + added * east, state
    )


def profile(root: float, z: float, depth: float) -> float:
    """Current at a depth, as a share of the current at the surface.

    Args:
        root: 1 / exponent of the power law; 0: the current is the same at all depths.
        z: depth below still water, from 0 to that of the bottom [m].
        depth: of the water [m]; 0: deep water, with the same current at all depths.

    """
    if depth == 0.0 or root == 0.0:
        return 1.0
    return math.pow(1.0 - z / depth, 1.0 / root)


def slope(root: float, z: float, depth: float) -> float:
    """Derivative of :func:`profile` with respect to z [1/m]; at the bottom 0, not infinite.

    Args:
        root, z, depth: as for :func:`profile`.

    """
    if depth == 0.0 or root == 0.0 or z == depth:
        return 0.0
    return -profile(root, z, depth) / root / (depth - z)


def velocity(current: Current, variation: Variation, share: float) -> Vector3:
    """Velocity of the water [m/s], or its derivative with respect to z [1/s], earth frame.

    Args:
        current, variation: mean and random part.
        share: profile at a depth, or its slope.

    """
    return (
        share * (current.speed * cos(current.direction) + variation.north),
        share * (current.speed * sin(current.direction) + variation.east),
        0.0,
    )
