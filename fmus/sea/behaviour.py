"""How Sea runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from math import fmod
from typing import NamedTuple, TypedDict

from auv_fmu import ocean_current, sea
from auv_fmu.ocean_current import Variation
from auv_fmu.random_numbers import MODULUS
from auv_fmu.sea import Sea
from auv_fmu.vectors import Vector3
from auv_fmu.waves import Components
from fmus.ports.port import Refusal


class Inputs(NamedTuple):
    """Where the vehicle is."""

    eta: Vector3


class Outputs(TypedDict):
    """How the water moves there."""

    water: Vector3
    dwater: Vector3
    elevation: float


def check(parameters: Sea) -> None:
    """Refuse waves that would break."""
    sea.check(parameters)


def begin(parameters: Sea, inputs: Inputs, t: float) -> tuple[Variation, Components, Outputs]:
    """State, the waves and outputs at the start."""
    state, components = ocean_current.begin(parameters.current), sea.regular_waves(parameters)
    return state, components, _seen(parameters, components, state, inputs.eta, t)


def derive(parameters: Sea) -> Components:
    """The waves, which do not change during a run."""
    return sea.regular_waves(parameters)


def advance(
    parameters: Sea, state: Variation, derived: Components, inputs: Inputs, t: float, h: float
) -> tuple[Variation, Components, Outputs]:
    """State and the waves after a step, and its outputs: computed at its beginning."""
    outputs = _seen(parameters, derived, state, inputs.eta, t)
    return ocean_current.advance(parameters.current, state, h), derived, outputs


def expected(state: Variation, outputs: Outputs) -> Outputs:
    """The outputs as they are: they belong to the beginning of the last step."""
    if not (1.0 <= state.random < MODULUS and fmod(state.random, 1.0) == 0.0):
        raise Refusal("its random numbers are of no sequence")
    return outputs


def _seen(
    parameters: Sea, components: Components, state: Variation, eta: Vector3, t: float
) -> Outputs:
    velocity, acceleration, elevation = sea.water(parameters, components, state, eta, t)
    return {"water": velocity, "dwater": acceleration, "elevation": elevation}
