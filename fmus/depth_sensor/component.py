"""Depth sensor: samples of the depth, with noise, bias, delay and losses."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __license__, __version__
from auv_fmu.language.random_numbers import DEPTH_SENSOR
from auv_fmu.navigation import sampling, sensors
from auv_fmu.navigation.sampling import SampleState
from auv_fmu.navigation.sensors import DepthSample, DepthSensor

SAMPLED = True


class Inputs(NamedTuple):
    """True depth."""

    z: Annotated[float, Variable("m", "True depth", name="eta.z")]


class Outputs(NamedTuple):
    """The last sample that has arrived."""

    sample: DepthSample


def check(parameters: DepthSensor) -> None:
    """Refuse a delay of too many periods."""
    sampling.check(parameters.sampling)


def start(parameters: DepthSensor, t: float) -> SampleState:
    """Return the state before the first sample."""
    return sampling.begin(parameters.sampling, sensors.depth_errors(parameters), DEPTH_SENSOR, t)


def derive(parameters: DepthSensor, state: SampleState, inputs: Inputs, t: float) -> SampleState:
    """Return the state after what is due at time t."""
    errors, true = sensors.depth_errors(parameters), sensors.wide(inputs.z, 0.0, 0.0)
    return sampling.advance(parameters.sampling, errors, state, true, t)


def update(derived: SampleState) -> SampleState:
    """Return the state after a step."""
    return derived


def outputs(derived: SampleState, t: float) -> Outputs:
    """Return the last sample that has arrived."""
    return Outputs(DepthSample(derived.held[0], t - derived.taken, derived.fresh))
