"""Samples of sensors: when they come, which are lost, and the statistics of their errors."""

from __future__ import annotations

from math import exp, hypot, radians, sqrt

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn
from scipy.stats import chi2

from auv_fmu import Refusal
from auv_fmu.language.arrays import Vector
from auv_fmu.navigation import sampling, sensors
from auv_fmu.navigation.sampling import WIDTH, Errors, Sampling
from fmus.depth_sensor import component as depth
from fmus.imu import component as imu

NONE = Errors(*(Vector((0.0,) * WIDTH),) * 3)


def samples(parameters: Sampling, h: float, n: int, errors: Errors = NONE, start: float = 0.0):
    """For each of n steps: time, what is held, when it was taken, and whether it is fresh.

    The measured value is the time itself.
    """
    state = sampling.begin(parameters, errors, 1, start)
    for k in range(n):
        t = start + k * h
        state = sampling.arrived(parameters, state, t)
        if sampling.is_due(parameters, state, t):
            state, error = sampling.erred(errors, state, t)
            state = sampling.sampled(parameters, state, error + Vector((t,) * WIDTH), t)
        yield t, state.held[0], state.taken, state.fresh


@pytest.mark.parametrize("period", [0.0, 0.02, 0.05, 0.2, 1.0])
@pytest.mark.parametrize("h", [0.02, 0.03])
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.3])
def test_samples_follow_a_list_of_events(period, h, delay):
    if delay > 16 * period:
        with pytest.raises(Refusal, match="raise period"):
            sampling.check(Sampling(period, delay))
        return
    times = [3.0 + k * h for k in range(400)]
    taken, due = [], 0.0
    for t in times:
        if t - 3.0 >= due - 1e-9:
            taken.append(t)
            due = period * (1 + int((t - 3.0) / period + 1e-6)) if period else 0.0
    arrivals = [(at if at == 3.0 else at + delay, at) for at in taken]
    before = -1.0
    for t, held, at, fresh in samples(Sampling(period, delay), h, 400, start=3.0):
        there = max(at for when, at in arrivals if when <= t + 1e-9)
        assert held == at == there
        assert fresh == (there != before)
        before = there


def test_as_many_samples_are_lost_as_the_probability_says_and_all_in_an_outage():
    n, loss = 6_000, 0.3
    parameters = Sampling(0.1, 0.1, loss, 500.0, 100.0)
    times = np.array([t for t, _, _, fresh in samples(parameters, 0.1, n) if fresh])
    silent = (times > 500.15) & (times < 600.05)
    assert not silent.any()
    share = 1.0 - len(times) / (n - 1000)
    assert share == pytest.approx(loss, abs=4 * sqrt(loss * (1 - loss) / n))


def test_an_outage_changes_no_other_sample():
    errors = NONE._replace(noise=Vector((1.0,) * WIDTH))
    whole = list(samples(Sampling(0.1, 0.0, 0.2), 0.1, 300, errors))
    parted = list(samples(Sampling(0.1, 0.0, 0.2, 10.0, 5.0), 0.1, 300, errors))
    assert [row for row in parted if row[3]] == [
        row for row in whole if row[3] and not 10.0 <= row[0] < 15.0 - 1e-9
    ]


def test_noise_is_white_with_its_variance():
    n = 10_000
    errors = NONE._replace(noise=Vector((2.0, 0.0, 0.5, 0.0, 0.0, 0.0)))
    state = sampling.begin(Sampling(), errors, 4, 0.0)
    found = []
    for k in range(n):
        state, error = sampling.erred(errors, state, 0.02 * k)
        found.append(error)
    x, zero, y = np.array(found).T[:3]
    assert not zero.any()
    for values, std in ((x, 2.0), (y, 0.5)):
        low, high = chi2(n).ppf([1e-4, 1 - 1e-4]) * std**2 / n
        assert low < (values**2).sum() / n < high
        assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 4 / sqrt(n)
    assert abs(np.corrcoef(x, y)[0, 1]) < 4 / sqrt(n)


def test_bias_is_drawn_once_and_walks_with_the_square_root_of_time():
    errors = Errors(NONE.noise, Vector((3.0,) * WIDTH), Vector((0.5,) * WIDTH))
    first, walked = [], []
    for seed in range(300):
        parameters = Sampling(seed=seed)
        state = sampling.begin(parameters, errors, 7, 0.0)
        begin = state.bias
        for t in (0.1, 0.5, 4.0):
            state, error = sampling.erred(errors, state, t)
            state = state._replace(last=t)
        assert error == state.bias
        first += begin
        walked += error - begin
    n = len(first)
    for values, variance in ((first, 9.0), (walked, 0.25 * 4.0)):
        low, high = chi2(n).ppf([1e-4, 1 - 1e-4]) * variance / n
        assert low < (np.array(values) ** 2).sum() / n < high


def test_attitude_is_turned_in_the_earth_frame_also_near_the_vertical():
    for eta in ((0.1, -0.4, 2.0), (0.0, radians(89.99), 1.0), (3.0, 1.2, -3.0)):
        error = np.array((0.01, -0.02, 0.03))
        found = sensors.erred_attitude(eta, Vector((*error, 0.0, 0.0, 0.0)))
        wanted = Turn.from_rotvec(error) * Turn.from_euler("ZYX", eta[::-1])
        given = Turn.from_euler("ZYX", tuple(found[:3])[::-1])
        assert (given * wanted.inv()).magnitude() < 1e-9


def test_imu_gives_what_euler_needs_to_restore_the_motion():
    """A vehicle on a circle that rolls: increments of velocity and attitude, gravity removed."""
    parameters = sensors.Imu(
        gyro=sensors.Gyro(0.0, 0.0, 0.0), accelerometer=sensors.Accelerometer(0.0, 0.0, 0.0)
    )

    def motion(t):
        eta = (0.3 * t, 0.5 * np.sin(t), 0.7 * t)
        return imu.Inputs(eta, (1.0 + 0.2 * t, 0.1 * t * t, exp(-t)))

    def velocity(u):
        return Turn.from_euler("ZYX", u.eta[::-1]).apply(u.nu)

    h = 0.05
    state = imu.start(parameters, motion(0.0), 0.0)
    turn, v = Turn.from_euler("ZYX", motion(0.0).eta[::-1]), velocity(motion(0.0))
    state = imu.derive(parameters, state, motion(0.0), 0.0)
    for k in range(1, 60):
        state = imu.derive(parameters, state, motion(h * k), h * k)
        sample = imu.outputs(state, h * k).sample
        v = v + h * (turn.apply(sample.f) + np.array((0.0, 0.0, 9.81)))
        turn *= Turn.from_rotvec(h * np.array(sample.omega))
        now = motion(h * k)
        assert v == pytest.approx(velocity(now), abs=1e-12)
        assert (turn * Turn.from_euler("ZYX", now.eta[::-1]).inv()).magnitude() < 1e-12


def test_noise_of_an_imu_is_its_density_at_any_rate():
    for interval in (0.01, 0.25):
        errors = sensors.inertial_errors(sensors.Imu(), interval)
        assert errors.noise[0] == pytest.approx(0.14e-3 * 9.81 / sqrt(interval))
        assert errors.noise[5] == pytest.approx(radians(0.0035) / sqrt(interval))


def test_component_refuses_a_delay_of_too_many_periods():
    parameters = sensors.DepthSensor(Sampling(0.1, 1.7))
    with pytest.raises(Refusal, match="16 would be under way"):
        depth.check(parameters)


def test_axes_of_noise_are_tilt_and_heading():
    noise = sensors.attitude_errors(sensors.AttitudeSensor()).noise
    assert hypot(noise[0], noise[1]) == pytest.approx(sqrt(2.0) * radians(0.5))
    assert noise[2] == pytest.approx(radians(2.0))
