"""Guidance and autopilots with both vehicles: offsets in a current, and what the pages say."""

from __future__ import annotations

from math import asin, pi, tan
from pathlib import Path

import numpy as np
import pytest

from auv_fmu import simulate
from orchestrator.commands.main import main
from orchestrator.cosim import PortName
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.scenario import read_scenario
from orchestrator.vehicle.cautions import follows_vehicle
from orchestrator.vehicle.signals import loops_of, tracking_error
from page_numbers import GUIDED, SPANS, over_seeds
from support.runs import compared
from support.tiers import slow

LAWS = "proportional", "integral", "adaptive"
CALM = {
    "sea.waves.spectrum": "none", "sea.current.speed": 0.0, "sea.current.sigma": 0.0,
    "plant.noise.std": 0.0,
}  # fmt: skip

#: Median over seeds, and what 5 % and 95 % are below, on the first and on the last leg [m].
EXPECTED = {
    ("los", "proportional"): ((1.62, 1.46, 1.80), (1.58, 1.39, 1.78)),
    ("los", "integral"): ((0.17, 0.13, 0.23), (0.12, 0.08, 0.16)),
    ("los", "adaptive"): ((0.17, 0.12, 0.23), (0.11, 0.08, 0.16)),
    ("los-remus", "proportional"): ((2.95, 2.65, 3.31), (2.90, 2.65, 3.14)),
    ("los-remus", "integral"): ((0.26, 0.12, 0.40), (0.19, 0.07, 0.31)),
    ("los-remus", "adaptive"): ((0.24, 0.11, 0.38), (0.19, 0.07, 0.30)),
}


@pytest.mark.parametrize(
    ("scenario", "current", "Delta", "speed", "until"),
    [("los", 0.3, 5.0, 1.0, 100.0), ("los-remus", 0.3, 15.0, 1.5, 125.0)],
)
@pytest.mark.parametrize("law", LAWS)
def test_offset_in_a_steady_current(scenario, current, Delta, speed, until, law):
    """On the first leg it is Delta tan(asin(v / U)) without memory; else it has died out.

    A dive slows the vehicle down along the leg, and the REMUS 100 slips sideways in the current.
    """
    values = {**CALM, "plant.current.y": current, "planner.law": law}
    result = simulate(scenario, values, stop_time=until)
    offset = Delta * tan(asin(current / speed)) if law == "proportional" else 0.0
    assert result["planner.y_e"][-1] == pytest.approx(offset, abs=0.05 * Delta * current / speed)
    if law != "proportional":
        assert result["planner.beta_hat"][-1] == pytest.approx(asin(current / speed), abs=0.02)


@pytest.mark.parametrize("scenario", GUIDED)
def test_error_of_the_run_is_across_the_leg(scenario):
    """The reference is abeam of the measured position; only noise along the leg differs."""
    (loop,) = loops_of(load_scenario(scenario)[1])
    for result in compared(scenario):
        across = np.hypot(result["planner.y_e"], result["planner.z_e"])
        away = np.linalg.norm(tracking_error(result, loop), axis=1)
        np.testing.assert_allclose(away[1:], across[1:], atol=0.02)


def test_heading_does_not_jump_and_legs_are_passed():
    """At the end it is south, and towards the current from the west."""
    result = simulate("los")
    assert np.abs(np.diff(result["planner.eta_d.psi"])).max() < 0.05
    assert [*np.unique(result["planner.active"])] == [1, 2, 3]
    assert result["planner.eta_d.psi"][-1] == pytest.approx(pi + asin(0.29), abs=0.05)


def test_planner_that_follows_the_vehicle_is_found():
    for scenario in (*GUIDED, "path"):
        system = load_scenario(scenario)[1]
        (loop,) = loops_of(system)
        found = loop.planner, follows_vehicle(system, loop)
        assert found == ("planner", scenario in GUIDED)


def test_no_warning_of_different_references(capsys, tmp_path):
    assert main(["run", "los", "--stop-time", "1", "--no-figures", "--out", str(tmp_path)]) == 0
    assert "different paths" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("scenario", "law", "n"),
    [("los", "integral", 3), ("los-remus", "adaptive", 3),
     *slow(*((*case, 60) for case in EXPECTED))],
)  # fmt: skip
def test_runs_with_other_seeds_are_within_the_bands_that_are_said(scenario, law, n):
    """All bands to their last digit; a few runs lie within three times the band."""
    found = over_seeds(scenario, False, n, {"planner.law": law})
    for (start, end), band in zip(SPANS[scenario], EXPECTED[scenario, law], strict=True):
        last = min(end, int(read_scenario(scenario).stop_time))
        others = found[f"error from {start} s to {last} s [m]"][1:]
        if n == 60:
            assert np.percentile(others, (50, 5, 95)) == pytest.approx(band, abs=0.0051)
        else:
            wide = band[2] - band[1] + 0.01
            assert band[1] - wide <= others.min()
            assert others.max() <= band[2] + wide


def test_remarks_say_these_numbers():
    for scenario, wanted in {
        "los": ("1.62 m", "(1.46 to 1.80 m", "0.17 m (0.13 to 0.23 m)"),
        "los-remus": ("2.95 m", "(2.65 to 3.31 m", "0.24 m (0.11 to 0.38 m)"),
    }.items():
        assert all(number in read_scenario(scenario).remark for number in wanted)


def test_waypoints_come_from_a_table(workplace):
    """Columns x, y, z, as for PathPlanner; it has no times."""
    Path("path.csv").write_text("x,y,z\n0,0,1\n30,0,2\n30,40,3\n")
    scenario = (
        'only = ["planner"]\n[components]\nplanner = "LosGuidance"\n[path]\nfile = "path.csv"\n'
    )
    Path("mine.toml").write_text(scenario)
    system = load_scenario("mine.toml")[1]
    names = ("count", "waypoint[3].x", "waypoint[3].y", "waypoint[3].z")
    assert [system.value(PortName("planner", name)) for name in names] == [3, 30.0, 40.0, 3.0]
    Path("path.csv").write_text("t,x,y,z\n0,0,0,1\n9,30,0,2\n")
    with pytest.raises(InputError, match="timed"):
        load_scenario("mine.toml")
