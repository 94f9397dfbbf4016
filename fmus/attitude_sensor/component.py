"""Attitude and heading reference (AHRS): samples of the attitude, with noise and bias."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __license__, __version__
from auv_fmu.language.quantities import EULER
from auv_fmu.language.random_numbers import ATTITUDE_SENSOR
from auv_fmu.language.vectors import Vector3
from auv_fmu.navigation import sampling, sensors
from auv_fmu.navigation.sampling import SampleState
from auv_fmu.navigation.sensors import AttitudeSample, AttitudeSensor

SAMPLED = True


class Inputs(NamedTuple):
    """True attitude."""

    eta: Annotated[Vector3, Variable(EULER, "True Euler angle")]


class Outputs(NamedTuple):
    """The last sample that has arrived."""

    sample: AttitudeSample


def check(parameters: AttitudeSensor) -> None:
    """Refuse a delay of too many periods."""
    sampling.check(parameters.sampling)


def start(parameters: AttitudeSensor, t: float) -> SampleState:
    """Return the state before the first sample."""
    errors = sensors.attitude_errors(parameters)
    return sampling.begin(parameters.sampling, errors, ATTITUDE_SENSOR, t)


def derive(parameters: AttitudeSensor, state: SampleState, inputs: Inputs, t: float) -> SampleState:
    """Return the state after what is due at time t."""
    state = sampling.arrived(parameters.sampling, state, t)
    if not sampling.is_due(parameters.sampling, state, t):
        return state
    state, error = sampling.erred(sensors.attitude_errors(parameters), state, t)
    sample = sensors.erred_attitude(inputs.eta, error)
    return sampling.sampled(parameters.sampling, state, sample, t)


def update(derived: SampleState) -> SampleState:
    """Return the state after a step."""
    return derived


def outputs(derived: SampleState, t: float) -> Outputs:
    """Return the last sample that has arrived."""
    phi, theta, psi = derived.held[0], derived.held[1], derived.held[2]
    return Outputs(AttitudeSample((phi, theta, psi), t - derived.taken, derived.fresh))
