"""Waves and an ocean current at the vehicle."""

from __future__ import annotations

from math import fmod
from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable, __author__, __citation__, __license__, __version__
from auv_fmu.language.quantities import POSITION
from auv_fmu.language.random_numbers import MODULUS
from auv_fmu.language.vectors import Vector3
from auv_fmu.water import ocean_current, sea
from auv_fmu.water.ocean_current import Variation
from auv_fmu.water.sea import Sea, WaterMotion
from auv_fmu.water.waves import Components


class Inputs(NamedTuple):
    """Position of the vehicle."""

    eta: Annotated[Vector3, Variable(POSITION, "Position of the vehicle, z down from still water")]


def check(parameters: Sea) -> None:
    """Refuse waves that would break."""
    sea.check(parameters)


def start(parameters: Sea) -> Variation:
    """Return the state at the start."""
    return ocean_current.begin(parameters.current)


def derive(parameters: Sea) -> Components:
    """Return the waves."""
    return sea.regular_waves(parameters)


def update(parameters: Sea, state: Variation, h: float) -> Variation:
    """Return the state after a step."""
    return ocean_current.advance(parameters.current, state, h)


def outputs(
    parameters: Sea, state: Variation, derived: Components, inputs: Inputs, t: float
) -> WaterMotion:
    """Return the motion of the water at the vehicle."""
    return sea.water(parameters, derived, state, inputs.eta, t)


def check_state(state: Variation) -> None:
    """Refuse an invalid state of the random numbers."""
    if not (1.0 <= state.random < MODULUS and fmod(state.random, 1.0) == 0.0):
        raise Refusal("its random numbers are of no sequence")
