"""Doppler velocity log (DVL): samples of the velocity over ground in the body frame."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __license__, __version__
from auv_fmu.language.random_numbers import DVL
from auv_fmu.language.vectors import Vector3
from auv_fmu.navigation import sampling, sensors
from auv_fmu.navigation.sampling import SampleState
from auv_fmu.navigation.sensors import BODY_VELOCITY, Dvl, VelocitySample

SAMPLED = True


class Inputs(NamedTuple):
    """True velocity."""

    nu: Annotated[Vector3, Variable(BODY_VELOCITY, "True velocity over ground in the body frame")]


class Outputs(NamedTuple):
    """The last sample that has arrived."""

    sample: VelocitySample


def check(parameters: Dvl) -> None:
    """Refuse a delay of too many periods."""
    sampling.check(parameters.sampling)


def start(parameters: Dvl, t: float) -> SampleState:
    """Return the state before the first sample."""
    return sampling.begin(parameters.sampling, sensors.velocity_errors(parameters), DVL, t)


def derive(parameters: Dvl, state: SampleState, inputs: Inputs, t: float) -> SampleState:
    """Return the state after what is due at time t."""
    u, v, w = inputs.nu
    errors, true = sensors.velocity_errors(parameters), sensors.wide(u, v, w)
    return sampling.advance(parameters.sampling, errors, state, true, t)


def update(derived: SampleState) -> SampleState:
    """Return the state after a step."""
    return derived


def outputs(derived: SampleState, t: float) -> Outputs:
    """Return the last sample that has arrived."""
    u, v, w = derived.held[0], derived.held[1], derived.held[2]
    return Outputs(VelocitySample((u, v, w), t - derived.taken, derived.fresh))
