"""The BlueROV2 Heavy in the loop: an allocation between its controller and its thrusters."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import Table
from orchestrator.runs.result import loops_in
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.cautions import velocities_reaching
from orchestrator.vehicle.signals import AllocatedLoop, loops_of, tracking_error
from support import bluerov_oracle as oracle
from support.runs import run

SCENARIOS = ("bluerov", "bluerov-pd")
COMMANDS = [f"allocation.command[{k}]" for k in range(1, 9)]


@pytest.fixture(scope="module", params=SCENARIOS)
def result(request, native: Path) -> tuple[str, Table]:
    found = run(closed_loop(native, read_scenario(request.param)), 70.0, 0.02, loop="compiled")
    assert found.failure is None
    return request.param, found


def test_controllers_follow_the_path_as_the_remark_and_the_page_say(result):
    name, table = result
    away = np.linalg.norm(tracking_error(table, AllocatedLoop()), axis=1)
    largest = [
        away[(table.time >= start) & (table.time <= end)].max()
        for start, end in ((0, 20), (20, 50), (65, 70))
    ]
    expected = {"bluerov": (0.59, 0.38, 0.018), "bluerov-pd": (0.92, 0.75, 0.012)}
    assert largest == pytest.approx(expected[name], abs=0.006)


def test_thrusters_move_as_is_said_and_none_is_at_its_limit(result):
    name, table = result
    commands = table.step_values(*COMMANDS)
    assert np.abs(commands).max() < 1.0
    moves = np.abs(np.diff(commands, axis=0)).sum(axis=0).mean() / 70.0
    assert moves == pytest.approx({"bluerov": 1.36, "bluerov-pd": 0.39}[name], abs=0.03)
    posture = np.degrees(np.abs(table.group("plant.eta.phi", "plant.eta.theta")).max(axis=0))
    assert posture[0] < 4.0
    assert posture[1] == pytest.approx({"bluerov": 22.0, "bluerov-pd": 23.0}[name], abs=1.0)


def test_applied_forces_are_the_thrusts_by_the_published_geometry(result):
    _, table = result
    thrusts = table.group(*(f"plant.thrust[{k}]" for k in range(1, 9)))
    applied = table.group(*(f"plant.tau_applied.{k}" for k in "uvwpqr"))
    assert applied == pytest.approx(thrusts @ oracle.effect().T, abs=1e-9)


@pytest.mark.parametrize("name", SCENARIOS)
def test_loop_is_found_and_its_commands_are_those_that_the_allocation_takes(name):
    system = load(name, "native")
    [loop] = loops_of(system)
    assert loop == AllocatedLoop()
    assert loop.commanded == tuple(f"allocation.tau.{k}" for k in "uqr")
    assert velocities_reaching(system, loop) == [f"plant.dy.{k}" for k in "xyz"] * (
        name == "bluerov-pd"
    )


def test_a_run_is_measured_drawn_and_read_again(tmp_path, capsys):
    command = ["run", "bluerov", "--kind", "native", "--stop-time", "0.5", "--out", str(tmp_path)]
    assert main(command) == 0
    assert loops_in(json.loads((tmp_path / "run.json").read_text())) == (AllocatedLoop(),)
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert {"l2_effort", "peak_command", "total_variation", "final_error"} <= metrics.keys()
    assert (tmp_path / "bluerov.png").is_file()
    printed = capsys.readouterr().err
    assert "skipped" not in printed
    assert "nothing feeds" not in printed


def test_both_kinds_are_the_same_bit_for_bit():
    one, two = (simulate("bluerov", kind=kind, stop_time=3.0) for kind in ("python", "native"))
    assert one.columns == two.columns
    for column in one.columns:
        assert np.array_equal(one[column], two[column]), column


def test_gains_and_masses_of_the_scenario_follow_the_rules_of_the_page():
    """Masses and drag of the oracle; half of the largest thrust in one direction."""
    values = {str(name): value for name, value in read_scenario("bluerov").parameters.items()}
    mass = oracle.MASS + np.diag(oracle.ADDED)[:3]
    turning = np.diag(oracle.INERTIA)[1:] + np.diag(oracle.ADDED)[4:]
    given = [values[f"planner.m{k}{k}"] for k in (1, 2, 3, 5, 6)]
    assert given == pytest.approx([*mass, *turning], rel=0.005)
    speeds = np.array((0.4, 0.1, 0.1, 0.0, 0.2, 0.4))
    slopes = np.diag(oracle.LINEAR) + oracle.QUADRATIC * speeds
    given = [values[f"planner.d{k}{k}"] for k in (1, 2, 3, 5, 6)]
    assert given == pytest.approx(np.delete(slopes, 3), rel=0.02)
    assert values["planner.righting.pitch"] == pytest.approx(13.5 * 9.82 * 0.01, abs=0.005)
    inverse = np.linalg.pinv(oracle.effect())
    astern = oracle.T200[0] * oracle.KGF
    alone = [-astern / np.abs(inverse[:, k]).max() for k in (0, 4, 5)]
    assert values["planner.tau_max"] == pytest.approx(np.multiply(0.5, alone), rel=0.08)
