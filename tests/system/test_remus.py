"""The REMUS 100 in the loop: an allocation between its controller and its fins and propeller."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import Table
from orchestrator.machine.errors import InputError
from orchestrator.runs.result import loops_in
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.cautions import velocities_reaching
from orchestrator.vehicle.signals import AllocatedLoop, loops_of, tracking_error
from page_numbers import largest_corner
from support.runs import run

SCENARIOS = ("remus", "remus-pd")


@pytest.fixture(scope="module", params=SCENARIOS)
def result(request, native: Path) -> tuple[str, Table]:
    found = run(closed_loop(native, read_scenario(request.param)), 280.0, 0.02, loop="compiled")
    assert found.failure is None
    return request.param, found


def test_controllers_follow_the_curve_as_the_remark_and_the_page_say(result):
    name, table = result
    away = np.linalg.norm(tracking_error(table, AllocatedLoop()), axis=1)
    largest = [
        away[(table.time >= start) & (table.time < end)].max()
        for start, end in ((0, 40), (40, 80), (80, 120), (120, 281))
    ]
    expected = {"remus": (5.57, 0.81, 0.26, 0.18), "remus-pd": (1.46, 0.77, 0.27, 0.19)}
    assert largest == pytest.approx(expected[name], abs=0.006)


def test_fins_are_at_their_limits_as_often_as_is_said(result):
    name, table = result
    moments = [f"{k}" for k in ("tau.q", "tau.r")]
    wanted = table.step_values(*(f"controller.{k}" for k in moments))
    attained = table.step_values(
        *(f"allocation.{k.replace('tau', 'tau_attained')}" for k in moments)
    )
    share = (np.abs(wanted - attained) > 1e-9).mean(axis=0)
    expected = {"remus": (0.33, 0.44), "remus-pd": (0.0, 0.0)}
    assert share == pytest.approx(expected[name], abs=0.01)


def test_fins_and_propeller_stay_within_their_limits(result):
    _, table = result
    largest = np.abs(table.group(*(f"plant.actuator.{k}" for k in ("delta_r", "delta_s", "n"))))
    assert (largest.max(axis=0) <= [np.radians(15.0), np.radians(15.0), 1525 * np.pi / 30]).all()


@pytest.mark.parametrize("name", SCENARIOS)
def test_loop_is_found_and_its_commands_are_those_that_the_allocation_takes(name):
    system = load(name, "native")
    [loop] = loops_of(system)
    assert loop == AllocatedLoop()
    assert loop.commanded == tuple(f"allocation.tau.{k}" for k in "uqr")
    assert loop.applied == tuple(f"plant.tau_applied.{k}" for k in "uqr")
    assert velocities_reaching(system, loops_of(system)[0]) == [f"plant.dy.{k}" for k in "xyz"] * (
        name == "remus-pd"
    )


def test_a_run_is_measured_drawn_and_read_again(tmp_path, capsys):
    command = ["run", "remus", "--kind", "native", "--stop-time", "0.5", "--out", str(tmp_path)]
    assert main(command) == 0
    record = json.loads((tmp_path / "run.json").read_text())
    assert loops_in(record) == (AllocatedLoop(),)
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert {"l2_effort", "peak_command", "total_variation", "final_error"} <= metrics.keys()
    # The moments of fins have no limits that are parameters.
    assert "saturated_fraction" not in metrics
    assert (tmp_path / "remus.png").is_file()
    assert "skipped" not in capsys.readouterr().err


def test_commands_are_measured_where_the_allocation_takes_them():
    """A lost actuator is missing between controller and allocation."""
    lost = [{"at": 0.0, "lose": "controller.tau.u"}]
    found = simulate("remus", kind="native", stop_time=2.0, events=lost)
    assert found.metrics()["peak_command"][0] == 0.0
    assert found["allocation.tau.u"].max() == 0.0


@pytest.mark.parametrize(
    ("name", "n", "angle", "moments"),
    [("remus", 95.4, 22.5, (2.25, 1.61)), ("remus-prestero", 80.5, 45.0, (3.62, 3.62))],
)
def test_the_planner_knows_the_steady_turn_with_full_rudder(name, n, angle, moments, tmp_path):
    """Its d66 and d22, and its limits: of an FMU that turns for a minute, and of its corners."""
    expected = {str(name): value for name, value in read_scenario(name).parameters.items()}
    vehicle = {name: value for name, value in expected.items() if name.startswith("plant.")}
    tight = {"plant.eta0.z": 5.0, "plant.nu0.u": 1.5, "plant.noise.std": 0.0}
    # The plane of the turn: nothing lifts the vehicle.
    tight["plant.net_buoyancy"] = 0.0
    scenario = tmp_path / "turn.toml"
    scenario.write_text(
        'only = ["plant"]\n[components]\nplant = "Remus100"\n[wires]\n'
        '"plant.tau" = false\n"plant.tau_w" = false\n"disturbance.nu" = false\n'
    )
    fins = {"plant.command.delta_r": np.radians(15.0), "plant.command.n": n}
    values = {**vehicle, **tight, **fins}
    turn = simulate(str(scenario), values, kind="native", stop_time=120.0)
    u, v, r, N = (
        turn[name][-1]
        for name in ("plant.nu_r.u", "plant.nu_r.v", "plant.nu.r", "plant.tau_applied.r")
    )
    assert np.hypot(u, v) == pytest.approx(1.5, abs=0.01)
    assert expected["planner.d66"] == pytest.approx(N / r, rel=0.02)
    assert expected["planner.d22"] == pytest.approx(-expected["planner.m11"] * u * r / v, rel=0.03)
    assert expected["planner.m22"] == expected["planner.m33"] == expected["planner.m11"]
    slowest = np.cos(np.radians(angle))
    limits = np.multiply(slowest**2, moments)
    assert expected["planner.tau_max"][1:] == pytest.approx(limits, abs=0.006)


@pytest.mark.parametrize(
    ("name", "moments", "corner"),
    [("remus", (2.25, 1.61), 58.0), ("remus-prestero", (3.62, 3.62), 96.0)],
)
def test_the_largest_corner_of_the_planner_is_as_the_page_says(name, moments, corner):
    assert largest_corner(name, moments) == pytest.approx(corner, abs=0.5)


def test_the_planner_refuses_corners_beyond_the_rudder():
    """A survey with lanes 40 m apart, as the page says; to starboard with a positive moment."""
    corners = ((0, 0, 2), (150, 0, 10), (150, 40, 10), (0, 40, 10), (0, 80, 5), (150, 80, 5))
    path = {
        f"planner.waypoint[{k}].{axis}": float(value)
        for k, point in enumerate(corners, start=1)
        for axis, value in zip("xyz", point, strict=True)
    }
    with pytest.raises(InputError, match=r"a moment in yaw of 1\.47 N\.m, 0\.098 beyond"):
        simulate("remus", path, kind="native", stop_time=1.0)
