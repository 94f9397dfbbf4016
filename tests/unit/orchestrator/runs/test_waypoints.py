"""Waypoints from a table, and a scenario that names one."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.waypoints import path_parameters
from support.texts import mentions


def parameters(path: Path, text: str) -> dict[str, object]:
    path.write_text(text, encoding="utf-8")
    return {str(name): value for name, value in path_parameters(path, "planner").items()}


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z\n1,2,3\n4,5,-6.5\n",
        "\ufeffz; X; y\r\n3; 1; 2\r\n-6.5; 4; 5\r\n",
        '"x"\t"y"\t"z"\n1\t2\t3\n4\t5\t-6.5\n\n',
    ],
)
def test_waypoints_are_run_through_at_the_cruise_speed(tmp_path: Path, text: str):
    assert parameters(tmp_path / "path.csv", text) == {
        "planner.count": 2,
        "planner.timed": False,
        "planner.waypoint[1].x": 1.0,
        "planner.waypoint[1].y": 2.0,
        "planner.waypoint[1].z": 3.0,
        "planner.waypoint[2].x": 4.0,
        "planner.waypoint[2].y": 5.0,
        "planner.waypoint[2].z": -6.5,
    }


def test_waypoints_with_times_are_passed_at_them(tmp_path: Path):
    found = parameters(tmp_path / "path.csv", "t,x,y,z\n0,0,0,0\n20,9,0,0\n")
    assert (found["planner.timed"], found["planner.waypoint[2].t"]) == (True, 20.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "columns t, x, y, z"),
        ("x,y\n1,2\n3,4\n", "columns t, x, y, z"),
        ("x,y,z,x\n1,2,3,4\n", "columns x,"),
        ("x,y,z\n1,2,3\n", "1 2 32"),
        ("x,y,z\n" + 33 * "1,2,3\n", "33 2 32"),
        ("x,y,z\n1,2,3\n1,2\n", "line 3 values"),
        ("x,y,z\n1,2,3\n1,2,3,4\n", "line 3 values"),
        ("x,y,z\n1,2,3\n1,2,deep\n", "3, z: 'deep'"),
        ("x,y,z\n1,2,3\n1,2,nan\n", "3, z: 'nan'"),
    ],
)
def test_table_that_is_no_path_is_refused_in_one_line(tmp_path: Path, text: str, reason: str):
    with pytest.raises(InputError) as error:
        parameters(tmp_path / "path.csv", text)
    assert str(error.value).startswith(f"{tmp_path / 'path.csv'}: ")
    assert mentions(str(error.value), reason)
    assert "\n" not in str(error.value)


def test_path_of_a_scenario_lies_beside_it_and_goes_to_its_planner(tmp_path: Path):
    (tmp_path / "path.csv").write_text("x,y,z\n0,0,0\n9,0,0\n")
    scenario = tmp_path / "mine.toml"
    scenario.write_text('[path]\nfile = "path.csv"\ncomponent = "leader"\n')
    found = {str(name): value for name, value in read_scenario(str(scenario)).parameters.items()}
    assert found["leader.waypoint[2].x"] == 9.0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('[path]\nfiel = "path.csv"\n', "path: 'fiel' file?"),
        ('[path]\ncomponent = "planner"\n', "path: file"),
        ('[path]\nfile = "none.csv"\n', "none.csv"),
        (
            '[path]\nfile = "path.csv"\n[parameters]\nplanner.count = 2\n',
            "planner.count path.csv",
        ),
    ],
)
def test_scenario_with_a_wrong_path_is_refused(tmp_path: Path, text: str, reason: str):
    (tmp_path / "path.csv").write_text("x,y,z\n0,0,0\n9,0,0\n")
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(InputError) as error:
        read_scenario(str(tmp_path / "mine.toml"))
    assert mentions(str(error.value), reason)
