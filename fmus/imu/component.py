"""Inertial measurement unit (IMU): specific force and rates, with noise and walking biases."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __license__, __version__
from auv_fmu.language.quantities import EULER
from auv_fmu.language.random_numbers import IMU
from auv_fmu.language.vectors import Vector3
from auv_fmu.navigation import sampling, sensors
from auv_fmu.navigation.sensors import BODY_VELOCITY, Imu, ImuState, InertialSample
from auv_fmu.paper.attitude import quaternion_from_euler

SAMPLED = True


class Inputs(NamedTuple):
    """True attitude and velocity, of whose differences the samples are made."""

    eta: Annotated[Vector3, Variable(EULER, "True Euler angle")]
    nu: Annotated[Vector3, Variable(BODY_VELOCITY, "True velocity over ground in the body frame")]


class Outputs(NamedTuple):
    """The last sample that has arrived."""

    sample: InertialSample


def check(parameters: Imu) -> None:
    """Refuse a delay of too many periods."""
    sampling.check(parameters.sampling)


def start(parameters: Imu, inputs: Inputs, t: float) -> ImuState:
    """Return the state before the first sample."""
    errors = sensors.inertial_errors(parameters, 0.0)
    samples = sampling.begin(parameters.sampling, errors, IMU, t)
    phi, theta, psi = inputs.eta
    velocity = sensors.velocity_over_ground(inputs.eta, inputs.nu)
    return ImuState(samples, velocity, quaternion_from_euler(phi, theta, psi))


def derive(parameters: Imu, state: ImuState, inputs: Inputs, t: float) -> ImuState:
    """Return the state after what is due at time t."""
    samples = sampling.arrived(parameters.sampling, state.samples, t)
    if not sampling.is_due(parameters.sampling, samples, t):
        return state._replace(samples=samples)
    phi, theta, psi = inputs.eta
    velocity = sensors.velocity_over_ground(inputs.eta, inputs.nu)
    sample = sensors.inertial(state, inputs.eta, velocity, t)
    errors = sensors.inertial_errors(parameters, t - samples.last)
    samples, error = sampling.erred(errors, samples, t)
    samples = sampling.sampled(parameters.sampling, samples, sample + error, t)
    return ImuState(samples, velocity, quaternion_from_euler(phi, theta, psi))


def update(derived: ImuState) -> ImuState:
    """Return the state after a step."""
    return derived


def outputs(derived: ImuState, t: float) -> Outputs:
    """Return the last sample that has arrived."""
    f_x, f_y, f_z, p, q, r = derived.samples.held
    age = t - derived.samples.taken
    return Outputs(InertialSample((f_x, f_y, f_z), (p, q, r), age, derived.samples.fresh))
