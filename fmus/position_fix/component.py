"""Position fixes of a USBL or a GNSS receiver: samples of the position, late and sometimes lost."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __license__, __version__
from auv_fmu.language.quantities import POSITION
from auv_fmu.language.random_numbers import POSITION_FIX
from auv_fmu.language.vectors import Vector3
from auv_fmu.navigation import sampling, sensors
from auv_fmu.navigation.sampling import SampleState
from auv_fmu.navigation.sensors import PositionFix, PositionSample

SAMPLED = True


class Inputs(NamedTuple):
    """True position."""

    eta: Annotated[Vector3, Variable(POSITION, "True position")]


class Outputs(NamedTuple):
    """The last sample that has arrived."""

    sample: PositionSample


def check(parameters: PositionFix) -> None:
    """Refuse a delay of too many periods."""
    sampling.check(parameters.sampling)


def start(parameters: PositionFix, t: float) -> SampleState:
    """Return the state before the first sample."""
    errors = sensors.position_errors(parameters)
    return sampling.begin(parameters.sampling, errors, POSITION_FIX, t)


def derive(parameters: PositionFix, state: SampleState, inputs: Inputs, t: float) -> SampleState:
    """Return the state after what is due at time t."""
    x, y, z = inputs.eta
    errors, true = sensors.position_errors(parameters), sensors.wide(x, y, z)
    return sampling.advance(parameters.sampling, errors, state, true, t)


def update(derived: SampleState) -> SampleState:
    """Return the state after a step."""
    return derived


def outputs(derived: SampleState, t: float) -> Outputs:
    """Return the last sample that has arrived."""
    x, y, z = derived.held[0], derived.held[1], derived.held[2]
    return Outputs(PositionSample((x, y, z), t - derived.taken, derived.fresh))
