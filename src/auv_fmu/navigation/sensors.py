"""Depth, attitude, velocity over ground, inertial and position sensors of a vehicle.

Each measures the motion of the origin of the body frame, without a lever arm. The defaults are
published numbers of small devices; the pages name the sources, and what is ours.

Densities of noise are given as the standard deviation of a mean over 1 s, with the same number as
per root of a hertz, and random walks as the standard deviation of the change in 1 s.
"""

from __future__ import annotations

from math import radians, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Vector
from auv_fmu.language.quantities import ACCELERATION, EULER, NU, POSITION, Members
from auv_fmu.language.variable import Variable
from auv_fmu.language.vectors import Vector3, Vector4, scale, sub
from auv_fmu.navigation.rotations import exponential, inverse, logarithm, product
from auv_fmu.navigation.sampling import Errors, SampleState, Sampling
from auv_fmu.paper.attitude import (
    euler_from_rotation,
    quaternion_from_euler,
    rotate,
    rotate_back,
    rotation_from_euler,
    rotation_from_quaternion,
)

#: Members of velocities and rates in the body frame.
BODY_VELOCITY: Members = {member: unit for member, unit in NU.items() if member in ("u", "v", "w")}
BODY_RATE: Members = {member: unit for member, unit in NU.items() if member in ("p", "q", "r")}

#: Gravity of the earth [m/s2], and a thousandth of it.
GRAVITY = 9.81
MILLI_G = 1e-3 * GRAVITY

_AGE = "Time since the sample was taken"
_FRESH = "The sample has arrived in this step"


class DepthSample(NamedTuple):
    """A sample of the depth."""

    z: Annotated[float, Variable("m", "Depth")] = 0.0
    age: Annotated[float, Variable("s", _AGE)] = 0.0
    fresh: Annotated[bool, Variable(description=_FRESH)] = False


class AttitudeSample(NamedTuple):
    """A sample of the attitude."""

    eta: Annotated[Vector3, Variable(EULER, "Euler angle", name="{}")] = (0.0, 0.0, 0.0)
    age: Annotated[float, Variable("s", _AGE)] = 0.0
    fresh: Annotated[bool, Variable(description=_FRESH)] = False


class VelocitySample(NamedTuple):
    """A sample of the velocity."""

    nu: Annotated[
        Vector3, Variable(BODY_VELOCITY, "Velocity over ground in the body frame", name="{}")
    ] = (0.0, 0.0, 0.0)
    age: Annotated[float, Variable("s", _AGE)] = 0.0
    fresh: Annotated[bool, Variable(description=_FRESH)] = False


class InertialSample(NamedTuple):
    """A sample of an IMU: means since the one before, in the body frame at that time."""

    f: Annotated[Vector3, Variable(ACCELERATION, "Specific force", name="f_{}")] = (0.0, 0.0, 0.0)
    omega: Annotated[Vector3, Variable(BODY_RATE, "Rate", name="{}")] = (0.0, 0.0, 0.0)
    age: Annotated[float, Variable("s", _AGE)] = 0.0
    fresh: Annotated[bool, Variable(description=_FRESH)] = False


class PositionSample(NamedTuple):
    """A sample of the position."""

    position: Annotated[Vector3, Variable(POSITION, "Position", name="{}")] = (0.0, 0.0, 0.0)
    age: Annotated[float, Variable("s", _AGE)] = 0.0
    fresh: Annotated[bool, Variable(description=_FRESH)] = False


class Bias(NamedTuple):
    """Standard deviations of a bias."""

    std: Annotated[float, Variable("m", "Standard deviation of the bias at the start", 0.0)] = 0.0
    walk: Annotated[
        float, Variable("m", "Standard deviation of its change in 1 s, a random walk", 0.0)
    ] = 0.0


class VelocityBias(NamedTuple):
    """Standard deviations of the bias of a velocity."""

    std: Annotated[float, Variable("m/s", "Standard deviation of the bias at the start", 0.0)] = 0.0
    walk: Annotated[
        float, Variable("m/s", "Standard deviation of its change in 1 s, a random walk", 0.0)
    ] = 0.0


class AttitudeNoise(NamedTuple):
    """Standard deviations of white noise of an attitude."""

    tilt: Annotated[
        float, Variable("rad", "Standard deviation of the noise about each horizontal axis", 0.0)
    ] = radians(0.5)
    heading: Annotated[
        float, Variable("rad", "Standard deviation of the noise about the vertical", 0.0)
    ] = radians(2.0)


class AttitudeBias(NamedTuple):
    """Standard deviations of the bias of an attitude."""

    tilt: Annotated[
        float, Variable("rad", "Standard deviation of the bias about each horizontal axis", 0.0)
    ] = 0.0
    heading: Annotated[
        float, Variable("rad", "Standard deviation of the bias about the vertical", 0.0)
    ] = 0.0
    walk: Annotated[
        float, Variable("rad", "Standard deviation of its change in 1 s, a random walk", 0.0)
    ] = 0.0


class Gyro(NamedTuple):
    """Errors of a gyro."""

    noise: Annotated[
        float, Variable("rad/s", "Standard deviation of the noise in a mean over 1 s", 0.0)
    ] = radians(0.0035)
    bias: Annotated[
        float, Variable("rad/s", "Standard deviation of the bias at the start", 0.0)
    ] = radians(0.05)
    walk: Annotated[
        float, Variable("rad/s", "Standard deviation of its change in 1 s, a random walk", 0.0)
    ] = radians(10.0 / 3600.0 / 60.0)


class Accelerometer(NamedTuple):
    """Errors of an accelerometer."""

    noise: Annotated[
        float, Variable("m/s2", "Standard deviation of the noise in a mean over 1 s", 0.0)
    ] = 0.14 * MILLI_G
    bias: Annotated[float, Variable("m/s2", "Standard deviation of the bias at the start", 0.0)] = (
        2.0 * MILLI_G
    )
    walk: Annotated[
        float, Variable("m/s2", "Standard deviation of its change in 1 s, a random walk", 0.0)
    ] = 0.04 * MILLI_G / 60.0


class DepthSensor(NamedTuple):
    """Parameters of a depth sensor; by default a Blue Robotics Bar30."""

    sampling: Annotated[Sampling, Variable(name="")] = Sampling(period=0.1)
    noise: Annotated[float, Variable("m", "Standard deviation of the noise", 0.0)] = 0.002
    bias: Bias = Bias()


class AttitudeSensor(NamedTuple):
    """Parameters of an AHRS; by default a VectorNav VN-100, all of whose error is noise."""

    sampling: Annotated[Sampling, Variable(name="")] = Sampling()
    noise: AttitudeNoise = AttitudeNoise()
    bias: AttitudeBias = AttitudeBias()


class Dvl(NamedTuple):
    """Parameters of a DVL; by default a Water Linked DVL-A50 up to 14 m above the bottom."""

    sampling: Annotated[Sampling, Variable(name="")] = Sampling(period=0.2, delay=0.1, loss=0.02)
    noise: Annotated[
        float, Variable("m/s", "Standard deviation of the noise of each axis", 0.0)
    ] = 0.01
    bias: VelocityBias = VelocityBias(std=0.001)


class Imu(NamedTuple):
    """Parameters of an IMU; by default a VectorNav VN-100."""

    sampling: Annotated[Sampling, Variable(name="")] = Sampling()
    gyro: Gyro = Gyro()
    accelerometer: Accelerometer = Accelerometer()


class PositionFix(NamedTuple):
    """Parameters of a USBL or a GNSS receiver; by default a USBL at 30 m."""

    sampling: Annotated[Sampling, Variable(name="")] = Sampling(period=1.0, delay=0.3, loss=0.1)
    noise: Annotated[Vector3, Variable(POSITION, "Standard deviation of the noise", 0.0)] = (
        0.3,
        0.3,
        0.3,
    )
    bias: Bias = Bias()


class ImuState(NamedTuple):
    """State of an IMU."""

    samples: SampleState
    velocity: Vector3  #: over ground at the last sample [m/s], earth frame
    attitude: Vector4  #: unit quaternion at the last sample


def wide(a: float, b: float, c: float) -> Vector:
    """Three numbers as the first ones of a sample."""
    return Vector((a, b, c, 0.0, 0.0, 0.0))


def depth_errors(sensor: DepthSensor) -> Errors:
    """Errors of a depth sensor."""
    noise, bias = sensor.noise, sensor.bias
    return Errors(wide(noise, 0.0, 0.0), wide(bias.std, 0.0, 0.0), wide(bias.walk, 0.0, 0.0))


def attitude_errors(sensor: AttitudeSensor) -> Errors:
    """Errors of an AHRS: rotation vectors in the earth frame [rad]."""
    noise, bias = sensor.noise, sensor.bias
    return Errors(
        wide(noise.tilt, noise.tilt, noise.heading),
        wide(bias.tilt, bias.tilt, bias.heading),
        wide(bias.walk, bias.walk, bias.walk),
    )


def velocity_errors(sensor: Dvl) -> Errors:
    """Errors of a DVL."""
    noise, (std, walk) = sensor.noise, sensor.bias
    return Errors(wide(noise, noise, noise), wide(std, std, std), wide(walk, walk, walk))


def position_errors(sensor: PositionFix) -> Errors:
    """Errors of a USBL or a GNSS receiver."""
    (x, y, z), (std, walk) = sensor.noise, sensor.bias
    return Errors(wide(x, y, z), wide(std, std, std), wide(walk, walk, walk))


def inertial_errors(imu: Imu, interval: float) -> Errors:
    """Errors of the specific force and the rate of an IMU.

    Args:
        imu: parameters.
        interval: time over which a sample is the mean [s]; 0: the sample has no noise.

    """
    force, rate = imu.accelerometer, imu.gyro
    share = 1.0 / sqrt(interval) if interval > 0.0 else 0.0
    a, w = share * force.noise, share * rate.noise
    return Errors(
        Vector((a, a, a, w, w, w)),
        Vector((force.bias, force.bias, force.bias, rate.bias, rate.bias, rate.bias)),
        Vector((force.walk, force.walk, force.walk, rate.walk, rate.walk, rate.walk)),
    )


def erred_attitude(eta: Vector3, error: Vector) -> Vector:
    """Euler angles after a small rotation of the earth frame.

    Args:
        eta: Euler angles (phi, theta, psi) [rad].
        error: rotation vector of :func:`attitude_errors` [rad].

    """
    turn = exponential((error[0], error[1], error[2]))
    phi, theta, psi = eta
    attitude = product(turn, quaternion_from_euler(phi, theta, psi))
    phi, theta, psi = euler_from_rotation(rotation_from_quaternion(attitude))
    return wide(phi, theta, psi)


def velocity_over_ground(eta: Vector3, nu: Vector3) -> Vector3:
    """Velocity [m/s] in the earth frame.

    Args:
        eta: Euler angles (phi, theta, psi) [rad].
        nu: (u, v, w) over ground [m/s], body frame.

    """
    phi, theta, psi = eta
    return rotate(rotation_from_euler(phi, theta, psi), nu)


def inertial(state: ImuState, eta: Vector3, velocity: Vector3, t: float) -> Vector:
    """Specific force (x, y, z) [m/s2] and rates (p, q, r) [rad/s], without errors.

    They are the increments of velocity and attitude since the last sample, divided by the time of
    that, in the body frame of the last sample. An IMU that corrects for coning and sculling gives
    these increments; integrated by Euler's scheme they restore velocity and attitude. The first
    sample is that of a vehicle at rest.

    Args:
        state: of the IMU.
        eta: Euler angles (phi, theta, psi) [rad].
        velocity: over ground [m/s], earth frame.
        t: time [s].

    """
    interval = t - state.samples.last
    phi, theta, psi = eta
    acceleration, rate = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if interval > 0.0:
        attitude = quaternion_from_euler(phi, theta, psi)
        turn = logarithm(product(inverse(state.attitude), attitude))
        rate = scale(1.0 / interval, turn)
        acceleration = scale(1.0 / interval, sub(velocity, state.velocity))
    a_x, a_y, a_z = acceleration
    force = rotate_back(rotation_from_quaternion(state.attitude), (a_x, a_y, a_z - GRAVITY))
    return Vector((*force, *rate))
