"""Events and inputs of a run: the numbers of a straight line that changes at the same instants."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auv_fmu.loop import closed_loop as line
from auv_fmu.loop.closed_loop import PAPER, Setting
from auv_fmu.paper import output_feedback, plant
from auv_fmu.paper.disturbance import disturbance
from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_scenario
from orchestrator.vehicle.signals import tracking_error
from support.runs import PD, compared
from support.texts import mentions

H = 0.02
STEPS = 120

#: Kinds of FMUs, loops, and isolation.
WAYS: list[dict[str, Any]] = [
    {"kind": "native", "loop": "compiled"},
    {"kind": "native", "loop": "python"},
    {"kind": "python", "loop": "python"},
    {"kind": "native", "isolate": True},
]

EVENTS = [
    {"at": 0.2, "override": {"controller.tau.u": 5.0}, "for": 0.3},
    {"at": 0.35, "bias": {"controller": {"eta": {"psi": 0.1}}}, "for": 0.5},
    {"at": 0.99, "drop": "plant.y", "for": 0.4},
    {"at": 1.2, "set": {"plant.current": {"x": 0.3, "z": -0.1}, "disturbance.A_f": 0.8}},
    {"at": 1.2, "set": {"controller.k_d": 40.0}, "for": 0.5},
    {"when": "plant.nu.u > 0.15", "lose": ["plant.tau.q", "plant.tau.r"], "for": 0.2},
    {"at": 1.9, "reset": "controller"},
]


@dataclass
class Span:
    """Instants from a first one to an end, which is not included."""

    begin: int
    end: int = STEPS + 1

    def __contains__(self, k: int) -> bool:
        return self.begin <= k < self.end


def straight(delayed: bool) -> Iterator[dict[str, Any]]:
    """The loop of `auv_fmu.loop.closed_loop`, written out again, with EVENTS."""
    setting: Setting = PAPER
    gauss = plant.white_noise(setting.plant.noise.seed).gauss
    vehicles = line.vehicles_at_start(setting)
    before, held, lost, fast = None, None, None, True
    for k in range(STEPS + 1):
        if k == 60:
            current = setting.plant._replace(current=(0.3, 0.0, -0.1))
            waves = setting.disturbance._replace(A_f=0.8)
            setting = setting._replace(plant=current, disturbance=waves)
        k_d = 40.0 if k in Span(60, 85) else PAPER.controller.k_d
        setting = setting._replace(controller=setting.controller._replace(k_d=k_d))
        parts = line.splits(setting)
        gains = setting.controller
        noise = tuple(gauss(0.0, 1.0) for _ in range(3))
        seen = line.scene(setting, vehicles, k * H, noise)
        if lost is None and seen.plant.nu[0] > 0.15 and not fast:
            lost = Span(k, k + 10)
        fast = seen.plant.nu[0] > 0.15
        measured = line.measurement(gains, seen)
        if k in Span(18, 43):
            phi, theta, psi = measured.euler
            measured = measured._replace(euler=(phi, theta, psi + 0.1))
        if k in Span(50, 70):
            measured = measured._replace(y=held)
        held = measured.y
        if k in (0, 95):
            control = output_feedback.initial_state(gains, measured.y)
        control = output_feedback.gated(gains, control, measured.y)
        signals = output_feedback.evaluate(gains, control, measured, H)
        # In Jacobi order an event changes the outputs of the next instant.
        now = signals.tau, seen.plant.nu_r, setting.disturbance
        commanded, nu_r, waves = before if before and delayed else now
        tau_w = disturbance(waves, nu_r, k * H)
        before = now
        if k == 95:
            # After a reset it shows its new outputs, as at the start.
            commanded = signals.tau
        if k in Span(10, 25):
            commanded = (5.0, *commanded[1:])
        if lost and k in lost:
            commanded = (commanded[0], 0.0, 0.0)
        row = {"tau": signals.tau, "commanded": commanded}
        yield {"k": k, "vehicle": vehicles.plant, "seen": seen, **row}
        control = output_feedback.step(control, signals, H)
        tau = plant.applied(setting.plant, commanded)
        vehicles = line.move(setting, vehicles, tau, tau_w, parts)
    assert lost is not None


@pytest.mark.parametrize(
    ("order", "way"),
    [*(("feedthrough", way) for way in WAYS), *(("jacobi", way) for way in WAYS[:2])],
    ids=str,
)
def test_events_equal_the_straight_line_bit_for_bit(way, order):
    table = simulate("fig4", stop_time=STEPS * H, order=order, events=EVENTS, **way)
    assert table.failure is None
    instants = list(straight(order == "jacobi"))
    after = {
        "plant.eta": [(*i["vehicle"].position, *i["seen"].plant.euler) for i in instants],
        "plant.nu": [i["seen"].plant.nu for i in instants],
        "plant.y": [i["seen"].y for i in instants],
    }
    for group, rows in after.items():
        names = [name for name in table.columns if name.startswith(f"{group}.")]
        np.testing.assert_array_equal(table.group(*names), rows, group)
    for group, key in (("controller.tau", "tau"), ("plant.tau", "commanded")):
        values = table.step_values(*(f"{group}.{k}" for k in "uqr"))
        np.testing.assert_array_equal(values, [i[key] for i in instants[:-1]], group)
    times = [event.time for event in table.events]
    assert times == sorted(times)
    assert len({event.event for event in table.events}) == len(EVENTS)


def test_a_component_with_longer_steps_takes_an_event_at_its_next_one():
    """The event lasts from the seventh to the eleventh instant; inputs are taken at even ones."""
    plain, biased = (
        simulate("fig4", stop_time=0.4, kind="native", steps={"controller": 0.04}, events=events)
        for events in ([], [{"at": 0.14, "for": 0.08, "bias": {"controller.eta.psi": 0.1}}])
    )
    first, second = (table.step_values("controller.eta.psi") for table in (biased, plain))
    difference = (first - second)[:, 0]
    # The vehicle answers a step later.
    np.testing.assert_array_equal(difference[:8], 0.0)
    np.testing.assert_allclose(difference[8:12], 0.1, atol=1e-3)
    np.testing.assert_allclose(difference[12:], 0.0, atol=1e-2)


def test_a_run_is_replayed_from_its_table_bit_for_bit(tmp_path):
    """Only the vehicle, with a CSV of the inputs that it had in the loop."""
    order = "gauss-seidel"
    loop = simulate("fig4", stop_time=2.0, order=order, kind="native")
    names = [name for name in loop.columns if name.startswith(("plant.tau.", "plant.tau_w."))]
    file = tmp_path / "inputs.csv"
    with file.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(("time", *names))
        writer.writerows(np.column_stack((loop.step_start, loop.step_values(*names))).tolist())
    scenario = tmp_path / "alone.toml"
    scenario.write_text(
        'only = ["plant"]\nstop_time = 2.0\n[inputs]\nfile = "inputs.csv"\nbetween = "hold"\n'
    )
    for way in WAYS:
        alone = simulate(scenario, order=order, **way)
        for name in alone.columns:
            # The last command never acts.
            is_state = not name.startswith("plant.tau")
            first, second = (
                t[name][1:] if is_state else t.step_values(name) for t in (alone, loop)
            )
            np.testing.assert_array_equal(first, second, name)


def test_water_that_moves_is_added_to_the_current(tmp_path):
    """A table for the input has the effect of a stronger current, bit for bit."""
    file = tmp_path / "water.csv"
    file.write_text("time,plant.water.x,plant.water.z\n0.0,0.25,-0.5\n")
    current = {"plant.current.x": 0.5}
    fed = simulate("fig4", current, stop_time=1.0, inputs=file, kind="native")
    stronger = {"plant.current.x": 0.75, "plant.current.z": -0.5}
    set_ = simulate("fig4", stronger, stop_time=1.0, kind="native")
    for name in set_.columns:
        if not name.startswith("plant.water."):
            np.testing.assert_array_equal(fed[name], set_[name], name)


def test_tables_of_inputs_side_by_side_act_as_one(tmp_path):
    """Rows of both at other times; one is interpolated, as the whole table is, and one is not."""
    x = [(0.0, 0.1), (0.3, 0.4), (0.9, -0.2)]
    (tmp_path / "x.csv").write_text("time,plant.water.x\n" + "".join(f"{t},{v}\n" for t, v in x))
    (tmp_path / "z.csv").write_text("time,plant.water.z\n0.0,0.5\n0.5,0.25\n")
    (tmp_path / "two.toml").write_text(
        'only = ["plant"]\nstop_time = 1.0\n[[inputs]]\nfile = "x.csv"\n'
        '[[inputs]]\nfile = "z.csv"\nbetween = "hold"\n'
    )
    two = simulate(tmp_path / "two.toml")
    times = np.arange(51) * 0.02
    z = np.where(times < 0.499, 0.5, 0.25)
    np.testing.assert_allclose(two["plant.water.x"], np.interp(times, *zip(*x, strict=True)))
    np.testing.assert_array_equal(two["plant.water.z"], z)
    rows = zip(times.tolist(), two["plant.water.x"].tolist(), z.tolist(), strict=True)
    text = "".join(f"{t!r},{u!r},{w!r}\n" for t, u, w in rows)
    (tmp_path / "both.csv").write_text(f"time,plant.water.x,plant.water.z\n{text}")
    one = simulate({"only": ["plant"]}, stop_time=1.0, inputs=[tmp_path / "both.csv"])
    for name in one.columns:
        np.testing.assert_allclose(two[name], one[name], atol=1e-12, err_msg=name)


@pytest.mark.parametrize(("between", "way"), [("hold", WAYS[1]), ("linear", WAYS[0])], ids=str)
def test_an_override_hides_a_table_of_inputs_until_it_ends(tmp_path, way, between):
    """The table changes during the override."""
    file, scenario = tmp_path / "water.csv", tmp_path / "tide.toml"
    file.write_text("time,plant.water.x\n0.0,0.1\n0.5,0.2\n1.0,0.4\n")
    scenario.write_text(
        'only = ["plant"]\nstop_time = 1.0\n[inputs]\nfile = "water.csv"\n'
        f'between = "{between}"\n[[events]]\nat = 0.2\nfor = 0.4\n'
        'override = { "plant.water.x" = -1.0 }\n'
    )
    table = simulate(scenario, **way)
    at = {
        "hold": lambda t: 0.1 if t < 0.499 else 0.2 if t < 0.999 else 0.4,
        "linear": partial(np.interp, xp=[0.0, 0.5, 1.0], fp=[0.1, 0.2, 0.4]),
    }[between]
    expected = [-1.0 if 0.199 < t < 0.599 else at(t) for t in table.time]
    np.testing.assert_allclose(table["plant.water.x"], expected, atol=1e-12)


def test_an_input_that_follows_a_table_is_not_set(tmp_path):
    file = tmp_path / "water.csv"
    file.write_text("time,plant.water.x\n0.0,0.25\n")
    events = [{"at": 0.5, "set": {"plant.water.x": 1.0}}]
    with pytest.raises(ValueError, match=r"event 1: plant\.water\.x .* override"):
        simulate("fig4", stop_time=1.0, inputs=file, events=events)


def test_water_that_swells_drags_along_a_vehicle_that_nothing_drives(tmp_path):
    """m dv/dt = d (c(t) - v) for c(t) = a t: v = a (t - T (1 - exp(-t / T))) with T = m / d."""
    file, a, T = tmp_path / "swell.csv", 0.04, 25.0 / 30.0
    file.write_text(f"time,plant.water.x\n0.0,0.0\n10.0,{10 * a}\n")
    values = {"plant.tau.u": 0.0, "plant.integrator": "rk4"}
    table = simulate("fig3a", values, stop_time=10.0, step=0.01, inputs=file, kind="native")
    expected = a * (table.time - T * -np.expm1(-table.time / T))
    # The water is constant during a step, so it is half a step late.
    np.testing.assert_allclose(table["plant.nu.u"], expected, atol=0.51 * 0.01 * a)


def test_friction_acts_against_the_velocity_through_the_water(tmp_path):
    """A vehicle that nothing drives ends with the current, however strong the friction is."""
    scenario = tmp_path / "adrift.toml"
    scenario.write_text(
        'only = ["plant", "disturbance"]\nstop_time = 10.0\n[parameters]\n'
        "disturbance.A_f = 5.0\ndisturbance.A_d = 0.0\nplant.current.x = 0.3\n"
        "plant.noise.std = 0.0\n"
    )
    table = simulate(scenario, kind="native")
    late = table.time > 5.0
    # The sign changes in every step, by h A_f / m11.
    np.testing.assert_allclose(table["plant.nu.u"][late], 0.3, atol=0.02 * 5.0 / 25.0)
    np.testing.assert_allclose(table["plant.nu_r.u"], table["plant.nu.u"] - 0.3, atol=1e-12)


def test_events_are_reported_recorded_and_drawn(workplace: Path, capsys):
    Path("mine.toml").write_text(
        'figure = "overlay"\nstop_time = 1.0\n'
        '[[events]]\nat = 0.3\nfor = 0.2\nlose = "controller.tau.r"\nlabel = "no yaw"\n'
        "[[events]]\nat = 0.4\nset = { controller.k_d = 60.0 }\n"
        '[[events]]\nwhen = "plant.eta.z > 100"\nstop = true\n' + PD
    )
    assert main(["run", "mine.toml", "--kind", "native", "--out", "out"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert any(mentions(line, "warning: mine: plant.eta.z > 100") for line in lines)
    assert "auv-fmu: mine: t = 0.3 s: lose controller.tau.r (no yaw)" in lines
    assert "auv-fmu: mine: t = 0.5 s: lose controller.tau.r, ended" in lines
    # The PD controller has no k_d.
    assert [line for line in lines if "t = 0.4 s" in line] == [
        "auv-fmu: mine: t = 0.4 s: set controller.k_d = 60"
    ]
    assert "auv-fmu: pd: t = 0.3 s: lose controller.tau.r (no yaw)" in lines
    events = json.loads(Path("out/run.json").read_text())["events"]
    assert [(e["time"], e["label"]) for e in events] == [
        (0.3, "no yaw"), (0.4, "set controller.k_d = 60"), (0.5, ""),
    ]  # fmt: skip
    svg = Path("out/mine.svg").read_text()
    assert "no yaw" in svg
    # Another command draws them from the record.
    assert main(["plot", "out", "plant.tau.*", "--out", "again.svg"]) == 0
    assert "no yaw" in Path("again.svg").read_text()


def test_a_run_that_an_event_stops_has_not_failed(workplace: Path, capsys):
    Path("stops.toml").write_text('[[events]]\nwhen = "plant.eta.x < 1.9"\nstop = true\n')
    assert main(["run", "fig4", "--kind", "native", "--events", "stops.toml", "--no-figures"]) == 0
    [line] = [s for s in capsys.readouterr().err.splitlines() if "ended at" in s]
    record = json.loads(Path("results/fig4/run.json").read_text())
    assert record["failure"] is None
    assert record["remark"] in line
    with Path("results/fig4/result.csv").open(encoding="utf-8") as table:
        x = [float(row["plant.eta.x"]) for row in csv.DictReader(table)]
    assert x[-1] < 1.9 <= min(x[:-1])


def test_a_system_without_the_events_of_its_scenario_is_reported(workplace: Path, capsys):
    left = "fault-sensor: only the system is used, without the scenario's events"
    assert main(["export", "fault-sensor", "--kind", "native"]) == 0
    assert f"auv-fmu: warning: {left}" in capsys.readouterr().err.splitlines()
    with pytest.warns(UserWarning, match=left):
        load("fault-sensor", "native")
    with pytest.raises(InputError, match=left):
        load("fault-sensor", "native", strict=True)


# Remarks of scenarios

#: By controller: largest error in the 20 s before the event, and after it; how long after the end
#: of the event the error exceeds half a metre [s]; a bound on the commanded force [N].
EXPECTED = {
    "fault-thruster": {"proposed": (0.26, 0.88, 2.2, 40.0), "PD": (0.22, 0.87, 2.9, 40.0)},
    "fault-sensor": {"proposed": (0.26, 5.7, 6.6, 219.0), "PD": (0.22, 1.18, 1.8, 80.0)},
    "current-step": {"proposed": (0.26, 0.51, None, 40.0), "PD": (0.22, 0.43, None, 40.0)},
}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", EXPECTED)
def test_remarks_are_true_in_every_draw_of_the_noise(name, seed):
    [event] = read_scenario(name).events
    begin, end = event["at"], event["at"] + event.get("for", 0.0)
    tables = compared(name, parameters={"plant.noise.seed": seed})
    for table, (before, largest, below, most) in zip(tables, EXPECTED[name].values(), strict=True):
        error = np.linalg.norm(tracking_error(table), axis=1)
        time, after = table.time, table.time >= begin
        assert error[(time >= begin - 20.0) & ~after].max() == pytest.approx(before, abs=0.0055)
        assert error[after].max() == pytest.approx(largest, rel=0.01, abs=0.0055)
        force = np.abs(table["controller.tau.u"][after]).max()
        assert force < most
        assert force > 216.0 or most < 219.0, "that of the remark"
        if below is not None:
            last = time[np.flatnonzero(error > 0.5)[-1]]
            assert last - end == pytest.approx(below, abs=0.05)
