"""What the parameters of components make of the setting of the loop."""

from __future__ import annotations

import pytest

from auv_fmu.loop.closed_loop import PAPER
from auv_fmu.paper.saturation import Saturation
from auv_fmu.remus import allocation, remus100
from auv_fmu.remus.tail import Tail
from auv_fmu.water.sea import Sea, regular_waves
from auv_fmu.water.waves import Spectrum, Waves
from orchestrator.machine.errors import InputError
from orchestrator.studies.batch.support import setting_of
from orchestrator.system.names import port_name

FMUS = {
    "plant": "AuvPlant",
    "controller": "ObserverController",
    "disturbance": "DisturbanceGenerator",
    "planner": "MotionPlanner",
}


def test_no_parameter_gives_section_4_1():
    assert setting_of(FMUS, {}, PAPER.h) == PAPER


def test_each_value_comes_to_its_component_alone():
    values = {
        "plant.ell": 0.5,
        "planner.m11": 20.0,
        "controller.theta_0[2]": 3.0,
        "controller.saturation": Saturation.ALGEBRAIC.value,
        "planner.h_max": 0.01,
    }
    setting = setting_of(FMUS, {port_name(k): v for k, v in values.items()}, 0.04)
    assert setting == PAPER._replace(
        plant=PAPER.plant._replace(ell=0.5),
        planner=PAPER.planner._replace(vehicle=PAPER.planner.vehicle._replace(m11=20.0)),
        controller=PAPER.controller._replace(theta_0=(0.0, 3.0, 0.0, 0.0), s=1),
        h_max=PAPER.h_max._replace(planner=0.01),
        h=0.04,
    )


def test_values_of_other_blocks_come_to_their_places():
    fmus = {
        **FMUS,
        "plant": "Remus100",
        "allocation": "Allocation",
        "planner": "PathPlanner",
        "sea": "Sea",
    }
    values = {
        "plant.fin.max": 0.2,
        "allocation.fin.max": 0.3,
        "planner.waypoint[2].y": 7.0,
        "planner.timed": True,
        "sea.waves.spectrum": Spectrum.NONE.value,
        "sea.depth": 20.0,
    }
    setting = setting_of(fmus, {port_name(k): v for k, v in values.items()}, 0.02)
    assert isinstance(setting.plant, remus100.Parameters)
    assert setting.plant == remus100.Parameters(tail=Tail(delta_max=0.2))
    assert setting.allocation == allocation.Parameters(tail=Tail(delta_max=0.3))
    assert setting.planner.waypoints.y[:3] == (6.0, 7.0, 10.0)
    assert setting.planner.waypoints.timed
    sea = Sea(Waves(spectrum=Spectrum.NONE), depth=20.0)
    assert setting.water.sea == sea
    assert setting.water.waves == regular_waves(sea)


def test_velocity_of_the_water_stands_beside_the_current_of_the_plant():
    values = {port_name("plant.water.y"): 0.3, port_name("plant.current.y"): 0.1}
    setting = setting_of(FMUS, values, PAPER.h)
    assert (setting.water, setting.plant.current) == ((0.0, 0.3, 0.0), (0.0, 0.1, 0.0))


@pytest.mark.parametrize(
    ("fmu", "name", "value", "what"),
    [
        ("PathPlanner", "planner.waypoint[2].z", 1000.0, "climbs or dives"),
        ("Sea", "sea.waves.Hs", 20.0, "break in this depth"),
        ("Remus100", "plant.diameter", 1.5, "slender hull"),
    ],
)
def test_values_that_do_not_fit_are_refused_as_the_fmu_does(fmu, name, value, what):
    name = port_name(name)
    with pytest.raises(InputError, match=f"initialisation refused: .*{what}"):
        setting_of({**FMUS, name.component: fmu}, {name: value}, 0.02)


def test_number_that_is_no_choice_is_refused_as_the_fmu_does():
    with pytest.raises(InputError, match=r"controller: saturation = 7: use one of 0 \(tanh\), 1"):
        setting_of(FMUS, {port_name("controller.saturation"): 7}, 0.02)


def test_water_moves_and_does_not_speed_up():
    setting = setting_of(FMUS, {port_name("plant.water.y"): 0.2}, 0.02)
    assert (setting.plant.current, setting.water) == ((0.0, 0.0, 0.0), (0.0, 0.2, 0.0))
    assert setting_of(FMUS, {port_name("plant.dwater.x"): 0.0}, PAPER.h) == PAPER
    with pytest.raises(InputError, match=r"plant\.dwater\.x: .* has no place for it"):
        setting_of(FMUS, {port_name("plant.dwater.x"): 0.1}, 0.02)
