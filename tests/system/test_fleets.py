"""Several vehicles in systems of their own: a nested SSP, run, changed, stored and exported."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator import load, read, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import System, write_ssp
from support.fleets import fleet_of

STOP = 0.8

#: Values of the second vehicle.
CHANGES = {"plant.eta0.y": 2.0, "plant.noise.seed": 7, "controller.eps_t": 30.0}

ORDER = [f"auv{i}.{name}" for name in ("planner", "plant", "disturbance", "controller")
         for i in (1, 2)]  # fmt: skip


def fleet() -> System:
    changes = {f"auv2.{name}": value for name, value in CHANGES.items()}
    return fleet_of(load("fig4", "native"), 2).with_parameters(changes)


@pytest.fixture(scope="module")
def ssp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    [path] = write_ssp(fleet(), tmp_path_factory.mktemp("fleet"))
    return path


def run(ssp: Path, out: Path, *options: str) -> np.ndarray:
    """The rows of a run on the command line."""
    command = ["run", str(ssp), "--out", str(out), "--no-figures", "--stop-time", str(STOP)]
    assert main([*command, *options]) == 0
    return np.loadtxt(out / "result.csv", delimiter=",", skiprows=1)


@pytest.mark.parametrize(("order", "loop"), [("gauss-seidel", "compiled"), ("jacobi", "python")])
def test_each_vehicle_has_the_numbers_of_its_own_run(ssp: Path, order: str, loop: str):
    together = simulate(ssp, stop_time=STOP, order=order, loop=loop)
    for name, changes in (("auv1", {}), ("auv2", CHANGES)):
        alone = simulate("fig4", changes, kind="native", stop_time=STOP, order=order)
        for column in alone.columns:
            assert (together[f"{name}.{column}"] == alone[column]).all(), column


def test_nested_components_are_set_ordered_and_apart(ssp: Path, tmp_path: Path):
    values = ["--set", "auv1.plant.eta0.x=1", "--set", "auv2.plant.eta0=0,1,2,0,0,0"]
    rows = run(ssp, tmp_path / "a", *values)
    assert (run(ssp, tmp_path / "b", *values, "--isolate") == rows).all()
    names = (tmp_path / "a" / "result.csv").read_text().splitlines()[0].split(",")
    start = dict(zip(names, rows[0], strict=True))
    places = [start[f"auv{i}.plant.eta.{axis}"] for i in (1, 2) for axis in "xyz"]
    assert places[0] == 1.0 and places[3:] == [0.0, 1.0, 2.0]
    stated = run(ssp, tmp_path / "c", *values, "--order", ",".join(ORDER))
    found = simulate(
        ssp, {"auv1.plant.eta0.x": 1, "auv2.plant.eta0": [0, 1, 2, 0, 0, 0]},
        stop_time=STOP, order=ORDER,
    )  # fmt: skip
    assert np.array_equal(stated, found.rows)
    slow = simulate(ssp, stop_time=STOP, steps={"auv2.controller": 0.06})
    assert len(np.unique(slow["auv2.controller.tau.u"])) <= 18
    assert len(np.unique(slow["auv1.controller.tau.u"])) > 40


def test_events_happen_to_nested_components(ssp: Path, tmp_path: Path):
    """Together with a table of inputs."""
    events, table = tmp_path / "events.toml", tmp_path / "water.csv"
    table.write_text("time,auv2.plant.water.y\n0,0\n0.8,-0.05\n")
    events.write_text(
        '[[events]]\nwhen = "auv1.plant.eta.z > 1e-4"\noverride = {auv1.controller.tau.u = 3.0}\n'
        '[[events]]\nat = 0.3\nbias = {"auv2.plant.y" = [0.1, 0.2, 0.3]}\n'
        "[[events]]\nat = 0.4\nset = {auv2.plant.water.x = 0.2}\n"
        '[[events]]\nat = 0.5\nfreeze = "auv1.plant.y"\n'
        '[[events]]\nat = 0.6\nreset = "auv2.controller"\n'
        '[[events]]\nat = 0.7\nlose = ["auv1.disturbance.tau_w", "auv2.disturbance.tau_w.u"]\n'
    )
    run(ssp, tmp_path / "r", "--events", str(events), "--inputs", str(table))
    events = json.loads((tmp_path / "r" / "run.json").read_text())["events"]
    assert len(events) == 6
    result = read(tmp_path / "r")
    assert result["auv1.plant.tau.u"][-1] == 3.0 != result["auv2.plant.tau.u"][-1]
    assert result["auv2.plant.water.x"][-1] == 0.2 and result["auv1.plant.water.x"][-1] == 0.0
    assert result["auv2.plant.water.y"][-1] == pytest.approx(-0.05, rel=1e-12)
    assert len(np.unique(result["auv1.controller.y.x"][-10:])) == 1
    assert len(np.unique(result["auv2.controller.y.x"][-10:])) > 1
    assert (result["auv1.plant.tau_w.v"][-5:] == 0.0).all()
    assert (result["auv2.plant.tau_w.v"][-5:] != 0.0).all()


@pytest.mark.parametrize(
    "options", [["--connectors"], ["--flat"], ["--format", "osp"]], ids=["nested", "flat", "osp"]
)
def test_an_exported_fleet_has_the_same_rows(ssp: Path, tmp_path: Path, options: list[str]):
    assert main(["export", str(ssp), "--out", str(tmp_path / "x"), *options]) == 0
    exported = tmp_path / "x" if "osp" in options else tmp_path / "x" / "fleet.ssp"
    rows = run(exported, tmp_path / "r")
    assert np.array_equal(rows, run(ssp, tmp_path / "own"))
    header = (tmp_path / "r" / "result.csv").read_text().splitlines()[0]
    assert ("auv2_plant.eta.x" if "--flat" in options else "auv2.plant.eta.x") in header
