"""The navigation filter against one of full matrices, written from the textbook."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation as Turn

from auv_fmu.navigation import navigation_filter
from auv_fmu.navigation.navigation_filter import Parameters, Samples
from auv_fmu.navigation.sensors import (
    AttitudeSample,
    DepthSample,
    InertialSample,
    PositionSample,
    VelocitySample,
)

H, STEPS, GRAVITY = 0.02, 250, np.array((0.0, 0.0, 9.81))
NONE, UNIT = np.zeros((3, 3)), np.eye(3)
PARAMETERS = Parameters()


def skew(a):
    return np.array(((0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0)))


class Textbook:
    """Sola (2017), chapters 5 to 7, with dense matrices, the Joseph form and a whole history."""

    def __init__(self, samples: Samples) -> None:
        noise, std0 = PARAMETERS.noise, PARAMETERS.start
        self.p, self.v = np.array(samples.fix.position), np.zeros(3)
        self.R = Turn.from_euler("ZYX", samples.attitude.eta[::-1])
        self.a_b, self.w_b = np.zeros(3), np.zeros(3)
        self.P = np.diag(
            np.square(
                (
                    *noise.position, *(std0.velocity,) * 3, noise.tilt, noise.tilt, noise.heading,
                    *(PARAMETERS.accelerometer.bias,) * 3, *(PARAMETERS.gyro.bias,) * 3,
                )
            )
        )  # fmt: skip
        self.history = []

    def predict(self, f, w):
        """Integrate the nominal state, and the covariance of its error."""
        a, turn = self.R.apply(f - self.a_b), Turn.from_rotvec(H * (w - self.w_b))
        R = self.R.as_matrix()
        F = np.block([
            [UNIT, H * UNIT, NONE, NONE, NONE],
            [NONE, UNIT, -H * skew(a), -H * R, NONE],
            [NONE, NONE, UNIT, NONE, -H * R],
            [NONE, NONE, NONE, UNIT, NONE],
            [NONE, NONE, NONE, NONE, UNIT],
        ])  # fmt: skip
        gyro, force = PARAMETERS.gyro, PARAMETERS.accelerometer
        densities = (0.0, force.noise, gyro.noise, force.walk, gyro.walk)
        Q = block_diag(*(H * density**2 * UNIT for density in densities))
        self.P = F @ self.P @ F.T + Q
        self.p = self.p + H * self.v + H * H / 2 * (a + GRAVITY)
        self.v = self.v + H * (a + GRAVITY)
        self.R *= turn
        self.history.append((a + GRAVITY, turn))

    def past(self, steps):
        """The nominal state some steps ago: the present one, integrated backwards."""
        p, v, R = self.p, self.v, self.R
        for a, turn in reversed(self.history[len(self.history) - steps :]):
            v = v - H * a
            p = p - H * v - H * H / 2 * a
            R *= turn.inv()
        return p, v, R

    def rows(self, steps):
        """Jacobians of position, velocity and attitude some steps ago."""
        d, R = steps * H, self.R.as_matrix()
        p, v, _ = self.past(steps)
        swept = self.v * d - (self.p - p) - GRAVITY * d * d / 2
        gained = self.v - v - GRAVITY * d
        return (
            np.hstack([UNIT, -d * UNIT, -skew(swept), -d * d / 2 * R, NONE]),
            np.hstack([NONE, UNIT, skew(gained), d * R, NONE]),
            np.hstack([NONE, NONE, UNIT, NONE, d * R]),
        )

    def measured(self, samples, later):
        """Innovations, Jacobian and deviations of the samples that have arrived."""
        noise = PARAMETERS.noise
        if samples.attitude.fresh and later:
            steps = round(samples.attitude.age / H)
            measured = Turn.from_euler("ZYX", samples.attitude.eta[::-1])
            yield (
                (measured * self.past(steps)[2].inv()).as_rotvec(),
                self.rows(steps)[2],
                (noise.tilt, noise.tilt, noise.heading),
            )
        if samples.depth.fresh:
            steps = round(samples.depth.age / H)
            expected = self.past(steps)[0][2:]
            yield samples.depth.z - expected, self.rows(steps)[0][2:], (noise.depth,)
        if samples.dvl.fresh:
            steps = round(samples.dvl.age / H)
            _, v, R = self.past(steps)
            back = R.inv().as_matrix()
            # The bias of the accelerometer enters about the attitude of the sample.
            _, velocity, turn = self.rows(steps)
            velocity[:, 9:12] = steps * H * R.as_matrix()
            turn[:, 12:] = 0.0
            jacobian = back @ (velocity + skew(v) @ turn)
            yield samples.dvl.nu - back @ v, jacobian, (noise.velocity,) * 3
        if samples.fix.fresh and later:
            steps = round(samples.fix.age / H)
            yield (
                samples.fix.position - self.past(steps)[0], self.rows(steps)[0], noise.position,
            )  # fmt: skip

    def correct(self, samples, later):
        """Return the normalised innovation squared, and its degrees of freedom."""
        rows = [*self.measured(samples, later)]
        if not rows:
            return 0.0, 0
        z, jacobian, std = (np.concatenate(part) for part in zip(*rows, strict=True))
        noise = np.diag(std**2)
        S = jacobian @ self.P @ jacobian.T + noise
        K = self.P @ jacobian.T @ np.linalg.inv(S)
        joseph = np.eye(15) - K @ jacobian
        self.P = joseph @ self.P @ joseph.T + K @ noise @ K.T
        p, v, turn, a, w = (K @ z).reshape(5, 3)
        self.p, self.v = self.p + p, self.v + v
        self.R = Turn.from_rotvec(turn) * self.R
        self.a_b, self.w_b = self.a_b + a, self.w_b + w
        return z @ np.linalg.solve(S, z), len(z)


def motion(k):
    """Position, velocity and attitude at step k: a dive with turns, through every heading."""
    t = k * H
    p = np.array((5.0 * np.sin(0.3 * t), 100.0 + 0.5 * t, 2.0 + np.cos(0.2 * t)))
    v = np.array((1.5 * np.cos(0.3 * t), 0.5, -0.2 * np.sin(0.2 * t)))
    return p, v, Turn.from_euler("ZYX", (0.9 * t, 0.8 * np.sin(0.7 * t), 0.4 * np.sin(t)))


def flight():
    """Samples at each step, at random times and of random ages."""
    random = np.random.default_rng(5)
    noise = PARAMETERS.noise
    a_b, w_b = random.normal(0.0, 0.02, 3), random.normal(0.0, 0.001, 3)
    for k in range(STEPS):
        ages = np.where(random.random(4) < 0.5, random.integers(0, 40, 4), 0).clip(0, k)
        fresh = random.random(4) < (0.6, 0.3, 0.2, 0.1)
        fresh |= k == 0
        then = [motion(k - age) for age in ages]
        before, now = motion(max(k - 1, 0)), motion(k)
        f = before[2].inv().apply((now[1] - before[1]) / H - GRAVITY) + a_b
        w = (before[2].inv() * now[2]).as_rotvec() / H + w_b
        tilt = Turn.from_rotvec(random.normal(0.0, (noise.tilt, noise.tilt, noise.heading)))
        eta = (tilt * then[0][2]).as_euler("ZYX")[::-1]
        z = then[1][0][2] + random.normal(0.0, noise.depth)
        nu = then[2][2].inv().apply(then[2][1]) + random.normal(0.0, noise.velocity, 3)
        p = then[3][0] + random.normal(0.0, noise.position)
        marks = [
            (float(age) * H, bool(is_fresh)) for age, is_fresh in zip(ages, fresh, strict=True)
        ]
        yield Samples(
            InertialSample(tuple(map(float, f)), tuple(map(float, w)), 0.0, True),
            AttitudeSample(tuple(map(float, eta)), *marks[0]),
            DepthSample(float(z), *marks[1]),
            VelocitySample(tuple(map(float, nu)), *marks[2]),
            PositionSample(tuple(map(float, p)), *marks[3]),
        )


def test_filter_is_the_one_of_the_textbook():
    state, textbook = None, None
    for k, samples in enumerate(flight()):
        if state is None:
            state = navigation_filter.begin(PARAMETERS, samples, 0.0)
            textbook = Textbook(samples)
        else:
            textbook.predict(np.array(samples.imu.f), np.array(samples.imu.omega))
        nis, dof = textbook.correct(samples, later=k > 0)
        found = navigation_filter.advance(PARAMETERS, state, samples, k * H)
        state, nominal = found.state, found.state.nominal
        assert nominal.position == pytest.approx(textbook.p, rel=0, abs=1e-9)
        assert nominal.velocity == pytest.approx(textbook.v, rel=0, abs=1e-9)
        attitude = Turn.from_quat((*nominal.attitude[1:], nominal.attitude[0]))
        assert (attitude * textbook.R.inv()).magnitude() < 1e-9
        assert nominal.force == pytest.approx(textbook.a_b, rel=0, abs=1e-9)
        assert nominal.rate == pytest.approx(textbook.w_b, rel=0, abs=1e-9)
        scale = np.sqrt(np.diag(textbook.P))
        assert np.abs((np.array(state.P) - textbook.P) / np.outer(scale, scale)).max() < 1e-9
        assert (found.nis, found.dof) == (pytest.approx(nis, rel=1e-7, abs=1e-9), dof)
    p, v, R = motion(STEPS - 1)
    assert np.abs(nominal.position - p).max() < 0.5
    assert np.abs(nominal.velocity - v).max() < 0.05
    assert (attitude * R.inv()).magnitude() < np.radians(2.0)


def test_a_sample_older_than_the_memory_is_ignored():
    state = navigation_filter.begin(PARAMETERS, next(flight()), 0.0)
    still = InertialSample((0.0, 0.0, -9.81))
    for k in range(1, 200):
        state = navigation_filter.advance(PARAMETERS, state, Samples(still), k * H).state
    for age, n in ((0.5, 1), (1.0, 1), (1.6, 0)):
        late = Samples(still, depth=DepthSample(2.0, age, True))
        assert navigation_filter.advance(PARAMETERS, state, late, 200 * H).dof == n


def test_the_past_is_interpolated_between_moments():
    """With a memory of 10 s the moments are 8 steps apart; a circle's past is still within 1 mm."""
    parameters = PARAMETERS._replace(delay_max=10.0)
    p, v, R = motion(0)
    samples = Samples(
        attitude=AttitudeSample(tuple(R.as_euler("ZYX")[::-1])), fix=PositionSample(tuple(p))
    )
    state = navigation_filter.begin(parameters, samples, 0.0)
    state = state._replace(nominal=state.nominal._replace(velocity=tuple(v)))
    for k in range(1, 400):
        before, now = motion(k - 1), motion(k)
        f = before[2].inv().apply((now[1] - before[1]) / H - GRAVITY)
        w = (before[2].inv() * now[2]).as_rotvec() / H
        imu = InertialSample(tuple(map(float, f)), tuple(map(float, w)))
        state = navigation_filter.advance(parameters, state, Samples(imu), k * H).state
    for age in (0.01, 0.13, 1.0, 5.0, 7.0):
        past = navigation_filter.then(state, age)
        p, v, R = motion(399 - age / H)
        assert past.known
        assert past.position == pytest.approx(p, abs=2e-3)
        assert past.velocity == pytest.approx(v, abs=2e-3)
        attitude = Turn.from_quat((*past.attitude[1:], past.attitude[0]))
        assert (attitude * R.inv()).magnitude() < 5e-3


def test_jacobian_of_a_delayed_sample_is_the_derivative_through_the_delay():
    """Errors a second ago, integrated forward by the nominal equations, are found again."""
    random = np.random.default_rng(3)
    imu = [(random.normal((0.3, 0.1, -9.6), 0.3), random.normal(0.0, 0.5, 3)) for _ in range(50)]

    def integrated(p, v, R, a_b, w_b):
        for f, w in imu:
            a = R.apply(f - a_b) + GRAVITY
            p, v, R = p + H * v + H * H / 2 * a, v + H * a, R * Turn.from_rotvec(H * (w - w_b))
        return p, v, R

    begin = np.zeros(3), np.array((1.0, -0.5, 0.2)), Turn.from_rotvec((0.3, -0.2, 1.0))
    p, v, R = integrated(*begin, np.zeros(3), np.zeros(3))
    state = navigation_filter.begin(PARAMETERS, Samples(), 0.0)
    quaternion = map(float, begin[2].as_quat()[[3, 0, 1, 2]])
    state = state._replace(
        nominal=navigation_filter.Nominal(
            tuple(begin[0]), tuple(begin[1]), tuple(quaternion), (0.0,) * 3, (0.0,) * 3
        )
    )
    for k, (f, w) in enumerate(imu, start=1):
        samples = Samples(InertialSample(tuple(map(float, f)), tuple(map(float, w))))
        state = navigation_filter.advance(PARAMETERS, state, samples, k * H).state
    past = navigation_filter.then(state, 1.0)
    assert past.position == pytest.approx(begin[0], abs=1e-12)
    for _ in range(20):
        errors = random.normal(0.0, 1e-5, (4, 3))
        dp, dv, turn, a_b = errors
        start = begin[0] + dp, begin[1] + dv, Turn.from_rotvec(turn) * begin[2]
        p_1, v_1, R_1 = integrated(*start, a_b, np.zeros(3))
        dx = np.concatenate((p_1 - p, v_1 - v, (R_1 * R.inv()).as_rotvec(), a_b, np.zeros(3)))
        rows = [navigation_filter.position_row(state.nominal, past, k) for k in range(3)]
        found = np.array(rows) @ dx
        # R at present stands for all R within the delay, for the bias only.
        assert found == pytest.approx(dp, abs=0.3 * np.abs(a_b).max() + 0.02 * np.abs(turn).max())
