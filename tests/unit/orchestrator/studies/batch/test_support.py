"""What the parameters of components make of the setting of the loop."""

from __future__ import annotations

import pytest

from auv_fmu.closed_loop import PAPER
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
        "controller.saturation": "algebraic",
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


def test_text_that_is_no_choice_is_refused_as_the_fmu_does():
    with pytest.raises(InputError, match="controller: saturation = 'x': use one of tanh, alge"):
        setting_of(FMUS, {port_name("controller.saturation"): "x"}, 0.02)


def test_water_moves_and_does_not_speed_up():
    setting = setting_of(FMUS, {port_name("plant.water.y"): 0.2}, 0.02)
    assert setting.plant.current == (0.0, 0.2, 0.0)
    assert setting_of(FMUS, {port_name("plant.dwater.x"): 0.0}, PAPER.h) == PAPER
    with pytest.raises(InputError, match=r"plant\.dwater\.x: the water .* does not speed up"):
        setting_of(FMUS, {port_name("plant.dwater.x"): 0.1}, 0.02)
