"""Several vehicles in one system: each is measured and drawn like a single one."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import PortName
from orchestrator.runs.wiring import read_wiring
from orchestrator.vehicle.indices import INDICES, VEHICLES
from orchestrator.vehicle.proof import gain_check
from orchestrator.vehicle.signals import STANDARD, Loop, loops_of
from support.live import needs_npm
from support.pages import stored

OTHER = Loop("tow", "pilot", "guide", "sea")

#: Values of the second vehicle, by names of the standard loop.
CHANGES = {
    "plant.eta0.y": 2.0, "plant.noise.seed": 7, "controller.eps_t": 30.0, "planner.tau_d.u": 12.0,
    "disturbance.A_f": 20.0,
}  # fmt: skip

ROLES = dict(zip(vars(STANDARD).values(), vars(OTHER).values(), strict=True))


def of_other(name: str) -> str:
    """A port of the standard loop as the other loop has it."""
    component, port = name.split(".", 1)
    return f"{ROLES[component]}.{port}"


def scenario(path: Path, components: dict[str, str], wires: dict, values: dict) -> Path:
    lines = ['figure = "tracking"', 'title = "Two"', "[components]"]
    lines += [f'{name} = "{fmu}"' for name, fmu in components.items()]
    lines += ["[wires]", *(f'"{to}" = {json.dumps(source)}' for to, source in wires.items())]
    lines += ["[parameters]", *(f"{name} = {value}" for name, value in values.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Both together, and each in a run of its own."""
    folder, standard = tmp_path_factory.mktemp("vehicles"), read_wiring()
    components = {ROLES[name]: fmu for name, fmu in standard["components"].items()}
    wires = {
        of_other(to): source and of_other(source)
        for to, source in standard["wires"].items()
        if source
    }
    values = {of_other(name): value for name, value in CHANGES.items()}
    both = scenario(folder / "two.toml", components, wires, values)
    alone = scenario(folder / "one.toml", {}, {}, CHANGES)
    for name in (both, alone, "fig4"):
        out = str(folder / Path(name).stem)
        run = ["run", str(name), "--kind", "native", "--stop-time", "2", "--out", out]
        assert main([*run, *(["--no-figures"] if name != both else [])]) == 0
    return folder


def test_loops_are_found_by_ports_and_wires(results):
    assert loops_of(load(results / "two.toml", "native")) == (STANDARD, OTHER)
    assert loops_of(load("fig5-pd", "native")) == (STANDARD,)
    # Parts that a scenario lacks have their standard names.
    assert loops_of(load("fig3a", "native")) == (STANDARD,)


@pytest.mark.parametrize(("alone", "name"), [("fig4", "plant"), ("one", "tow")])
def test_each_vehicle_has_the_numbers_of_its_own_run(results, alone, name):
    def values(folder):
        return json.loads((results / folder / "metrics.json").read_text())

    together, single = values("two"), values(alone)
    assert set(together[VEHICLES]) == {"plant", "tow"}
    assert not {index.name for index in INDICES} & set(together)
    found = together[VEHICLES][name]
    assert len(found) == 7 and found["velocities_reaching_controller"] == []
    assert {key: single[key] for key in found} == found
    certificates = "certificates.csv", f"certificates-{name}.csv"
    apart = (results / alone / certificates[0]).read_bytes()
    assert apart == (results / "two" / certificates[1]).read_bytes()


def test_each_vehicle_is_drawn(results):
    names = {path.name for path in (results / "two").iterdir()}
    for name in ("plant", "tow"):
        figures = (
            f"two-{name}{part}.{kind}" for part in ("", "-velocity") for kind in ("png", "svg")
        )
        assert names.issuperset(figures)
    # There is one figure of both together, and none of the others.
    assert "two.png" in names and "two-velocity.png" not in names
    plant, tow = ((results / "two" / f"two-{name}.png").read_bytes() for name in ("plant", "tow"))
    assert plant != tow


@needs_npm
@pytest.mark.usefixtures("script")
def test_all_vehicles_are_on_one_page(results, capsys):
    assert main(["view", str(results / "two")]) == 0
    page = results / "two" / "view.html"
    assert capsys.readouterr().out.split() == [str(page)]
    [loop] = stored(page.read_text(encoding="utf-8"))[0]["loops"]
    assert [vehicle["name"] for vehicle in loop["vehicles"]] == ["plant", "tow"]


def test_theorem_is_said_of_each(results):
    text = gain_check(load(results / "two.toml", "native"))
    assert text.startswith("plant:\n") and "\ntow:\n" in text


# Vehicles that a scenario counts


def test_one_vehicle_of_a_fleet_has_the_numbers_of_the_single_loop():
    single = simulate("fig4", stop_time=1.0, kind="native")
    of_fleet = simulate({"vehicles": 1}, stop_time=1.0, kind="native")
    assert of_fleet.columns == tuple(f"auv1.{name}" for name in single.columns)
    assert (of_fleet.rows == single.rows).all()


def test_each_vehicle_of_a_fleet_has_the_numbers_of_its_own_run():
    seeds = {"auv*.plant.noise.seed": {"first": 5, "step": 1}}
    three = simulate({"vehicles": 3, "parameters": seeds}, stop_time=1.0, kind="native")
    for number in (1, 2, 3):
        alone = simulate("fig4", {"plant.noise.seed": 4 + number}, stop_time=1.0, kind="native")
        for name in alone.columns:
            assert (three[f"auv{number}.{name}"] == alone[name]).all()


FLEET = """
vehicles = 3
figure = "comparison"
stop_time = 1.5

[components]
lead = "MotionPlanner"
"auv1.disturbance" = false

[wires]
"auv*.controller.y_d" = "lead.y_d"

[parameters]
"auv*.plant.eta0.y" = { first = 6.0, step = 4.0 }
auv2.controller.eps_t = 3.0

[compare]
name = "fleet-pd"
label = "PD"
components."auv*.controller" = "PdController"
wires."auv*.controller.dy" = "auv*.plant.dy"

[[events]]
at = 0.5
override = { "auv*.controller.tau.u" = 0.0 }
"""


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "fleet.toml").write_text(FLEET, encoding="utf-8")
    return folder


def test_a_star_in_a_scenario_is_each_vehicle(fleet):
    system = load(fleet / "fleet.toml", "native")
    wires = {str(wire.target): str(wire.source) for wire in system.connections}
    for number in (1, 2, 3):
        vehicle = f"auv{number}"
        assert wires[f"{vehicle}.controller.y_d.x"] == "lead.y_d.x"
        assert wires[f"{vehicle}.controller.dy_d.x"] == f"{vehicle}.planner.dy_d.x"
        y = PortName(f"{vehicle}.plant", "eta0.y")
        assert system.value(y) == 2.0 + 4.0 * number
    assert "auv1.disturbance" not in system.components
    assert "auv1.plant.tau_w.u" not in wires and "auv2.plant.tau_w.u" in wires
    assert [loop.name for loop in loops_of(system)] == ["auv1", "auv2", "auv3"]
    assert loops_of(system)[1] == Loop("auv2.plant", "auv2.controller", "lead", "auv2.disturbance")


def test_a_fleet_is_compared_with_another_controller(fleet, tmp_path):
    options = ["--kind", "native", "--no-figures", "--out", str(tmp_path)]
    assert main(["run", str(fleet / "fleet.toml"), *options]) == 0
    for folder, is_pd in ((tmp_path, False), (tmp_path / "fleet-pd", True)):
        table = np.genfromtxt(folder / "result.csv", delimiter=",", names=True, deletechars="")
        names = table.dtype.names
        assert "auv1.disturbance.tau_w.u" not in names and "lead.y_d.x" in names
        assert ("auv3.controller.dy.x" in names) == is_pd
        is_after = table["time"] > 0.51
        for number in (1, 2, 3):
            assert (table[f"auv{number}.plant.tau.u"][is_after] == 0.0).all()
        # Positions of three vehicles, taken apart without the code under test.
        places = np.array([[table[f"auv{i}.plant.eta.{k}"] for k in "xyz"] for i in (1, 2, 3)])
        apart = [np.linalg.norm(a - b, axis=0) for a, b in combinations(places, 2)]
        metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        assert metrics["smallest_distance"] == pytest.approx(np.min(apart), rel=1e-12)
        assert metrics[VEHICLES].keys() == {"auv1", "auv2", "auv3"}


def test_many_vehicles_have_only_one_figure_together(tmp_path, capsys):
    many = tmp_path / "many.toml"
    many.write_text("vehicles = 11\nstop_time = 0.1\n", encoding="utf-8")
    assert main(["run", str(many), "--kind", "native", "--out", str(tmp_path / "out")]) == 0
    assert {p.name for p in (tmp_path / "out").glob("*.png")} == {"many.png"}
    assert "11 vehicles" in capsys.readouterr().err


def test_values_of_each_vehicle_on_the_command_line_and_in_studies(fleet, tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    from orchestrator import sweep  # noqa: PLC0415

    study = {
        "scenario": str(fleet / "fleet.toml"), "stop_time": 0.5,
        "vary": {"auv*.controller.eps_t": [1.0, 30.0]},
    }  # fmt: skip
    result = sweep(study, kind="native", out=tmp_path / "s", workers=1)
    assert list(result["auv*.controller.eps_t"]) == [1.0, 30.0]
    assert len(set(result["auv3.total_variation.u"])) == 2
    assert np.isfinite(result["smallest_distance"]).all()
    same = simulate(
        fleet / "fleet.toml", {"auv*.controller.eps_t": 30.0}, stop_time=0.5, kind="native"
    )
    varied = same.metrics()[VEHICLES]["auv3"]["total_variation"][0]
    assert result["auv3.total_variation.u"][1] == varied
