"""A reference through waypoints, in the place of the planner of the paper."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from auv_fmu.guidance import path_planner
from auv_fmu.guidance.path_planner import Waypoints
from orchestrator import load
from orchestrator.commands.main import main
from orchestrator.cosim import PortName, System, read_component
from orchestrator.machine.errors import InputError
from orchestrator.program.components import refusals
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.signals import tracking_error
from support.archives import fmu, variable
from support.runs import companion, run
from support.texts import mentions

#: Near the default path, at times: straight ahead, a rest, and a turn to starboard.
TABLE = "t,x,y,z\n3,3,6,0\n23,13,6,2\n33,13,6,2\n60,13,16,2\n"


@pytest.mark.parametrize(
    ("name", "distances", "peaks"),
    [("path", (0.65, 0.32), (43.0, 56.0)), ("companion", (0.84, 0.41), (28.9, 29.1))],
)
def test_controllers_follow_the_survey_as_its_remark_says(
    native: Path, name: str, distances, peaks
):
    """In the first pair of corners, and in the second; peaks of all of 1,000 draws."""
    system = companion("path").system if name == "companion" else load("path", "native")
    noise = {PortName("plant", "noise.seed"): 2}
    result = run(system.with_parameters(noise), 100.0, 0.02, loop="compiled")
    assert result.failure is None
    away = np.linalg.norm(tracking_error(result), axis=1)
    corners = [away[(result.time > a) & (result.time < b)].max() for a, b in ((25, 50), (55, 80))]
    assert corners == pytest.approx(distances, abs=0.01)
    assert peaks[0] < np.abs(result["controller.tau.u"]).max() < peaks[1]
    assert away[-250:].max() < 0.05


@pytest.mark.parametrize("step", [0.1, 0.7])
def test_fmu_gives_the_closed_form_at_whatever_step(native: Path, step: float):
    """Also where a step leads over whole roundings."""
    result = run(closed_loop(native, read_scenario("path")), 98.0, step)
    waypoints = Waypoints()
    first = path_planner.first_corner(waypoints, 0.0)
    for i in range(0, len(result.time), 7):
        t = float(result.time[i])
        corner = path_planner.corner_ahead(waypoints, first, t)
        reference = path_planner.reference(waypoints, corner, t)
        for group, expected in zip(("y_d", "dy_d", "ddy_d"), reference, strict=True):
            found = result.group(*(f"planner.{group}.{axis}" for axis in "xyz"))[i]
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("places", "why"),
    [
        # Legs at 80 degrees on opposite courses, and steeper ones that pass by the vertical.
        (((0, 0, 0), (10, 0, 56.7), (0, 0, 113.4)), r"waypoint 2, .* 90\.0 "),
        (((0, 0, 0), (1, 0, 5), (0.2, 0.05, 10)), r"waypoint 2, .* 88\.\d .*, 3\.\d"),
        (((0, 0, 0), (9, 0, 0), (0, 0, 1e-12)), "waypoint 2"),
    ],
)
def test_path_through_the_vertical_is_refused_in_one_line(native: Path, places, why: str):
    system = closed_loop(native, read_scenario("path"))
    values = {
        PortName("planner", f"waypoint[{k}].{axis}"): value
        for k, place in enumerate(places, start=1)
        for axis, value in zip("xyz", place, strict=True)
    }
    steep = system.with_parameters({PortName("planner", "count"): 3, **values})
    with pytest.raises(InputError, match=why) as error:
        run(steep, 1.0, 0.02)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("table", "why"),
    [
        ("x,y,z\n0,0,0\n10,0,56.7\n0,0,113.4\n", "waypoint 2, (9.9, 0, 56.7)"),
        ("x,y,z\n0,0,0\n1,0,56.7\n", "waypoint 1 2 89.0"),
        ("x,y,z\n0,0,0\n9,0,0\n0,0,0\n", "waypoint 2"),
        (TABLE, None),
    ],
)
def test_check_says_of_a_path_what_a_run_would(workplace: Path, capsys, table, why):
    (workplace / "survey.csv").write_text(table)
    (workplace / "mine.toml").write_text(
        '[components]\nplanner = "PathPlanner"\n[path]\nfile = "survey.csv"\n'
    )
    assert main(["check", "mine.toml"]) == (2 if why else 0)
    output = capsys.readouterr().out
    assert mentions(output, f"problem: planner: {why}") if why else "problem: " not in output


def test_another_model_of_the_name_is_left_alone(tmp_path: Path):
    file = fmu(tmp_path / "a.fmu", variable("count", "parameter"))
    with zipfile.ZipFile(file) as archive:
        text = archive.read("modelDescription.xml").decode()
    with zipfile.ZipFile(file, "w") as archive:
        renamed = text.replace('modelName="M"', 'modelName="PathPlanner"')
        archive.writestr("modelDescription.xml", renamed)
    component = read_component("planner", file)
    assert component.description.modelName == "PathPlanner"
    assert [*refusals(System("s", {"planner": component}, ()))] == []
