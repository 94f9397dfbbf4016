"""Waves and a current in the loop of FMUs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auv_fmu.water import sea
from auv_fmu.water.ocean_current import Variation
from auv_fmu.water.sea import Sea
from orchestrator.cosim import PortName
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.signals import tracking_error
from support.runs import compared, run


def test_controllers_follow_the_survey_below_waves_as_its_remark_says():
    """In the first 25 s and in the last 40 s; with these seeds no command saturates."""
    expected = ((0.85, 0.30), 66.0), ((1.05, 0.33), 35.0)
    for result, (distances, peak) in zip(compared("sea"), expected, strict=True):
        away = np.linalg.norm(tracking_error(result), axis=1)
        found = [away[result.time < 25.0].max(), away[result.time > 60.0].max()]
        assert found == pytest.approx(distances, abs=0.006)
        assert np.abs(result["controller.tau.u"]).max() == pytest.approx(peak, abs=0.5)
        water = result.group(*(f"sea.water.{axis}" for axis in "xyz"))
        assert np.abs(water).max() == pytest.approx(0.38, abs=0.006)


@pytest.mark.parametrize("step", [0.02, 0.3])
def test_vehicle_moves_in_the_water_of_its_place(native: Path, step: float):
    """The outputs of Sea at the beginning of a step act during it."""
    system = closed_loop(native, read_scenario("sea")).with_parameters(
        {PortName("sea", "current.sigma"): 0.0}
    )
    result = run(system, 6.0, step)
    assert result.failure is None
    default = Sea()
    rows = sea.regular_waves(default)
    for i in range(0, len(result.time) - 1, 3):
        place = tuple(map(float, result.group(*(f"plant.eta.{axis}" for axis in "xyz"))[i]))
        expected = sea.water(default, rows, Variation(0.0, 0.0, 1.0), place, float(result.time[i]))
        for group, values in zip(("water", "dwater"), expected[:2], strict=True):
            found = result.step_values(*(f"plant.{group}.{axis}" for axis in "xyz"))[i]
            np.testing.assert_allclose(found, values, rtol=1e-9, atol=1e-12)


def test_a_calm_sea_changes_nothing(native: Path):
    """Bit for bit the same run as without the component."""
    scenario = read_scenario("sea")
    calm = {
        PortName("sea", "waves.spectrum"): "none",
        PortName("sea", "current.speed"): 0.0,
        PortName("sea", "current.sigma"): 0.0,
    }
    beside = closed_loop(native, scenario).with_parameters(calm)
    with_sea = run(beside, 4.0, 0.02)
    without = run(
        replace(
            beside,
            components={k: v for k, v in beside.components.items() if k != "sea"},
            connections=tuple(
                c
                for c in beside.connections
                if "sea" not in (c.source.component, c.target.component)
            ),
            parameters={k: v for k, v in beside.parameters.items() if k.component != "sea"},
        ),
        4.0,
        0.02,
    )
    for name in without.columns:
        assert np.array_equal(without[name], with_sea[name]), name
