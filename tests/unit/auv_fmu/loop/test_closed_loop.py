"""The loop of Fig. 2; tests/system compares the loop of FMUs with it."""

from math import sin, sqrt

import numpy as np
import pytest

from auv_fmu.loop.closed_loop import Setting, closed_loop
from auv_fmu.paper import motion_planner
from auv_fmu.paper.disturbance import Disturbance
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.pd import PdGains
from auv_fmu.paper.plant import Localisation, Parameters
from auv_fmu.paper.saturation import MAXIMUM_SLOPE

QUIET = Parameters(noise=Localisation(std=0.0))


def test_loop_starts_where_section_4_1_says():
    """At rest, level and without noise; with sin(0) = sign(0) = 0 all of (56) vanishes."""
    [start] = closed_loop(0, Setting(plant=QUIET))
    y, origin = (2.35, 6.0, 0.0), (0.0, 0.0, 0.0)
    assert start.t == 0.0
    level = (1.0, 0.0, 0.0, 0.0)
    assert start.vehicles.plant == ((2.0, 6.0, 0.0), level, (0.0,) * 6, origin, origin)
    assert start.scene.plant == (origin, y, origin, (0.0,) * 6, (0.0,) * 6)
    assert start.vehicles.planner == ((0.0, 0.0, -2.0), 0.0, 0.0, (0.0,) * 5)
    assert start.controller_state == (y, origin, (0.0,) * 4, 0.0)
    assert start.scene.y == y
    assert start.scene.reference.y_d == (0.35, 0.0, -2.0)
    assert start.signals.e == (2.0, 6.0, 2.0)
    assert start.signals.z == (0.0, 0.0, 0.0)
    assert start.tau_w == (0.0,) * 6


def test_first_step_moves_no_position_but_all_velocities():
    """Euler from rest: positions follow one step after the velocities."""
    start, first = closed_loop(1, Setting(plant=QUIET))
    assert first.t == 0.02
    assert first.vehicles.plant.position == start.vehicles.plant.position
    tau_u, tau_q, tau_r = start.tau
    expected = (0.02 * tau_u / 25.0, 0.0, 0.0, 0.0, 0.02 * tau_q / 22.5, 0.02 * tau_r / 15.0)
    assert first.vehicles.plant.nu_r == pytest.approx(expected, rel=1e-12)


def test_disturbance_acts_at_the_time_of_its_instant():
    """(56) without friction, at t_k = k h."""
    setting = Setting(disturbance=Disturbance(0.0, 2.0, 3.0), plant=QUIET, h=0.05)
    for k, instant in enumerate(closed_loop(20, setting)):
        assert instant.t == pytest.approx(0.05 * k)
        assert instant.tau_w == pytest.approx((2.0 * sin(3.0 * 0.05 * k),) * 6)


def test_measurement_has_white_noise_of_the_localisation_systems_deviation():
    """Mean and deviation within five of their own standard deviations, on each axis."""
    std, n = 0.01, 2000
    run = closed_loop(n - 1, Setting(plant=Parameters(noise=Localisation(std, seed=3))))
    noise = np.array([np.subtract(k.scene.y, k.scene.plant.y) for k in run]) / std
    assert np.abs(noise.mean(axis=0)).max() < 5.0 / sqrt(n)
    assert np.abs(noise.std(axis=0) - 1.0).max() < 5.0 / sqrt(2 * n)
    neighbours = np.corrcoef(np.hstack([noise[:-1], noise[1:]]), rowvar=False)
    assert np.abs(neighbours - np.eye(6)).max() < 5.0 / sqrt(n)


def test_noise_follows_from_its_seed():
    def first(seed):
        [start] = closed_loop(0, Setting(plant=Parameters(noise=Localisation(seed=seed))))
        return start.scene.y

    seeds = [1, 2, -1, 0, 2**31 - 1, -(2**31)]
    assert [first(seed) for seed in seeds] == [first(seed) for seed in seeds]
    assert len({first(seed) for seed in seeds}) == len(seeds)


@pytest.mark.parametrize("name", MAXIMUM_SLOPE)
def test_closed_loop_of_any_saturation_function_converges(name):
    """Theorem 2: the tracking error ends in a ball; 10 cm in 60 s from 6 m for our numbers.

    Near rest a gain counts s'_M times, so that ball is 1 / s'_M times as large.
    """
    *_, last = closed_loop(3000, Setting(controller=Gains(s=name), plant=QUIET))
    assert np.abs(last.signals.e).max() < 0.1 / MAXIMUM_SLOPE[name]


@pytest.mark.parametrize("gains", [Gains(eps_t=10.0), PdGains(eps_t=10.0)])
def test_loop_is_the_same_in_axes_whose_z_is_up(gains):
    """Reading 16: y, z and all turns about them change sign, x, surge and roll do not.

    Friction acts on the velocity, whatever the axes are; the waves of (56) do not.
    """
    friction = Disturbance(A_f=0.5, A_d=0.0)
    down = Setting(
        QUIET._replace(eta0=(2.0, 6.0, 0.0, 0.3, -0.4, 0.5)),
        gains,
        friction,
        motion_planner.Parameters(),
    )
    up = Setting(
        QUIET._replace(eta0=(2.0, -6.0, 0.0, 0.3, 0.4, -0.5)),
        gains,
        friction,
        motion_planner.Parameters(tau_d=(5.0, -1.0, -2.0), eta0=(0.0, 0.0, 2.0, 0.0, 0.0)),
    )
    turned = np.array([1.0, -1.0, -1.0])
    for first, second in zip(closed_loop(300, down), closed_loop(300, up), strict=True):
        for group in ("y", "dy", "euler"):
            expected = turned * getattr(first.scene.plant, group)
            np.testing.assert_allclose(getattr(second.scene.plant, group), expected, atol=1e-9)
        np.testing.assert_allclose(second.tau, turned * first.tau, atol=1e-9)
        np.testing.assert_allclose(
            second.scene.reference.y_d, turned * first.scene.reference.y_d, atol=1e-9
        )
