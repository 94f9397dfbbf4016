"""What stands in the loop of Fig. 2, where there are several of them."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from auv_fmu.guidance import path_planner
from auv_fmu.loop.blocks import sea_motion, sea_waves
from auv_fmu.loop.closed_loop import PAPER, Setting, closed_loop
from auv_fmu.paper import plant
from auv_fmu.paper.disturbance import Disturbance
from auv_fmu.paper.plant import Localisation
from auv_fmu.remus import allocation, remus100
from auv_fmu.water.ocean_current import Current
from auv_fmu.water.sea import Sea
from auv_fmu.water.waves import Spectrum, Waves

QUIET = PAPER._replace(plant=plant.Parameters(noise=Localisation(std=0.0)))

REMUS = Setting(
    remus100.Parameters(noise=Localisation(std=0.0)), allocation=allocation.Parameters()
)


def positions(setting: Setting, delayed: bool = False, steps: int = 100) -> np.ndarray:
    return np.array([i.vehicles.plant.position for i in closed_loop(steps, setting, delayed)])


@pytest.mark.parametrize("setting", [QUIET, REMUS])
def test_water_is_added_to_the_current_of_the_vehicle(setting):
    flow = (0.25, -0.5, 0.125)
    of_vehicle = setting._replace(plant=setting.plant._replace(current=flow))
    told = setting._replace(water=flow)
    assert positions(of_vehicle).tolist() == positions(told).tolist() != positions(setting).tolist()


def test_sea_without_waves_and_variation_is_steady_water():
    """0.5 m/s to the east, up to the rounding of sin and cos; friction would make more of it."""
    smooth = QUIET._replace(disturbance=Disturbance(A_f=0.0))
    sea = Sea(
        Waves(spectrum=Spectrum.NONE), Current(speed=0.5, direction=pi / 2, root=0.0, sigma=0.0)
    )
    in_sea = positions(smooth._replace(water=sea_waves(sea)))
    steady = positions(smooth._replace(water=(0.0, 0.5, 0.0)))
    np.testing.assert_allclose(in_sea, steady, rtol=0.0, atol=1e-12)


def test_sea_is_told_of_the_vehicle_one_step_late_in_jacobi_order():
    """What acts is the sea of the instant, at the place of the instant before."""
    waves = sea_waves(Sea())
    setting = QUIET._replace(water=waves)
    for delayed in (False, True):
        run = list(closed_loop(20, setting, delayed))
        places = [instant.vehicles.plant.position for instant in run]
        if delayed:
            places = [places[0], *places[:-1]]
        expected = [
            sea_motion(waves, instant.vehicles.water, place, instant.t)
            for instant, place in zip(run, places, strict=True)
        ]
        assert len(set(expected)) == len(run)
        assert [instant.water for instant in run] == expected


def test_reference_on_a_path_is_that_of_its_time():
    """At constant speed on the middle of the first leg: 0.5 m/s along (12, 0, 4) m."""
    run = list(closed_loop(600, QUIET._replace(planner=path_planner.Parameters())))
    instant = run[600]
    along = np.array([12.0, 0.0, 4.0]) / np.sqrt(160.0)
    # The first corner would be passed after half of a rounding of 6 s.
    expected = np.array([3.0, 6.0, 0.0]) + 0.5 * (12.0 - 3.0) * along
    np.testing.assert_allclose(instant.scene.reference.y_d, expected, atol=1e-9)
    np.testing.assert_allclose(instant.scene.reference.dy_d, 0.5 * along, atol=1e-12)


def test_command_reaches_the_fins_two_steps_late_in_jacobi_order():
    """It reaches the allocation one step late, and what that allocates the fins another one."""
    for delayed, late in ((False, 0), (True, 2)):
        run = list(closed_loop(20, REMUS, delayed))
        commands = [
            allocation.evaluate(REMUS.allocation, i.signals.tau, (0.0, 0.0, 0.0)).command
            for i in run
        ]
        assert commands[5] != commands[6]
        first = [commands[0]] * late
        assert [i.tau for i in run] == [*first, *commands[: len(commands) - late]]


def test_no_disturbance_reaches_the_remus():
    """Of (56) it shows what it shows a vehicle at rest."""
    for instant in closed_loop(50, REMUS):
        assert len(set(instant.scene.tau_w)) == 1
    calm = REMUS._replace(disturbance=REMUS.disturbance._replace(A_d=0.0))
    assert positions(calm).tolist() == positions(REMUS).tolist()
