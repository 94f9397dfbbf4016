"""`auv-fmu` as a user types it."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy.util import read_csv

from orchestrator.commands.main import main
from orchestrator.runs import SCENARIOS_FOLDER as SCENARIOS
from orchestrator.runs import bundle
from orchestrator.runs.folder import LEDGER
from orchestrator.runs.preparation import load
from orchestrator.studies.study import STUDIES_FOLDER as STUDIES
from support.texts import mentions, tells
from support.tiers import slow


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.name != LEDGER}


@pytest.mark.usefixtures("quick_builds")
@pytest.mark.parametrize(("name", "content"), [("AuvPlant.fmu", "cut short"), ("build.json", "[]")])
def test_build_replaces_what_is_not_what_was_built(dist, workplace, refused, capsys, name, content):
    """If forced; an unchanged bundle is not written again."""
    path = shutil.copytree(dist, workplace / "bundle") / name
    path.write_text(content)
    assert name in refused("build", "--out", "bundle")
    assert path.read_text() == content
    assert main(["build", "--out", "bundle", "--force"]) == 0
    assert path.read_bytes() == (dist / name).read_bytes()
    before = {p: p.stat().st_mtime_ns for p in path.parent.iterdir()}
    assert main(["build", "--out", "bundle"]) == 0
    assert {p: p.stat().st_mtime_ns for p in path.parent.iterdir()} == before
    assert "up to date" in capsys.readouterr().out


@pytest.fixture
def quick_builds(dist, monkeypatch):
    """Copy the FMUs of `dist` instead of building them again."""

    def copy(module: str, folder: Path, *options: str, **how: object) -> None:
        shutil.copytree(dist, folder, dirs_exist_ok=True)

    monkeypatch.setattr(bundle, "run_fmus", copy)


@pytest.mark.usefixtures("quick_builds")
def test_run_replaces_a_cached_fmu_that_is_not_what_was_built(workplace, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(workplace))
    bundle.current_fmus.cache_clear()
    try:
        fmu = bundle.current_fmus() / "AuvPlant.fmu"
        whole = fmu.read_bytes()
        fmu.write_bytes(whole[:1000])
        bundle.current_fmus.cache_clear()
        assert main(["run", "fig4", "--stop-time", "0.1", "--no-figures"]) == 0
        assert (bundle.current_fmus() / "AuvPlant.fmu").read_bytes() == whole
        # The damaged file is not ours to overwrite.
        assert fmu.read_bytes() == whole[:1000]
    finally:
        bundle.current_fmus.cache_clear()


def test_run_writes_only_into_its_folder(workplace, capsys):
    """A table, metrics and figures."""
    assert main(["run", "fig4", "--stop-time", "0.5", "--set", "plant.noise.std=0"]) == 0
    assert files(workplace) == {"results"} and files(workplace / "results") == {"fig4"}
    folder = workplace / "results" / "fig4"
    figures = {f"{stem}.{end}" for stem in ("fig4", "fig4-velocity") for end in ("png", "svg")}
    tables = {"result.csv", "metrics.json", "certificates.csv", "run.json"}
    assert files(folder) == tables | figures
    table = read_csv(folder / "result.csv")
    assert table.dtype.names[0] == "time" and len(table) == 26
    values = json.loads((folder / "metrics.json").read_text())
    assert values["scenario"] == "fig4"
    assert values["parameters"] == {"plant.noise.std": 0.0}
    assert (values["stop_time"], values["step"], values["order"]) == (0.5, 0.02, "feedthrough")
    for key in ("l2_effort", "rms_effort", "peak_command", "saturated_fraction",
                "total_variation", "final_error"):  # fmt: skip
        assert len(values[key]) == 3
    assert "written to" in capsys.readouterr().out


def test_a_run_ends_with_a_verdict_and_its_figure(workplace, capsys):
    """The verdict is computed again from the table; without noise y is the true control point."""
    arguments = ["run", "FIG4", "--set", "plant.noise.std=0", "--stop-time"]
    assert main([*arguments, "15"]) == 0
    heading, *_, verdict, place, figure = capsys.readouterr().out.splitlines()
    assert heading == "fig4 --stop-time 15 --set plant.noise.std=0"
    assert place == f"written to {Path('results', 'fig4')}{os.sep}"
    assert Path(figure.removeprefix("figure: ")).read_bytes().startswith(b"\x89PNG")
    table = read_csv("results/fig4/result.csv")
    e = np.column_stack([table[f"plant.y.{k}"] - table[f"planner.y_d.{k}"] for k in "xyz"])
    far = table["time"][np.linalg.norm(e, axis=1) > 1.0][-1]
    last = np.linalg.norm(np.abs(e[table["time"] >= 10.0]).max(axis=0))
    said = re.match(
        r"fig4: within 1 m of the reference from (.*) s on, within (.*) cm at the end", verdict
    )
    assert far <= float(said[1]) <= far + 0.12
    assert last <= 0.01 * float(said[2]) <= last + 0.01
    assert main([*arguments, "0.1", "--no-figures"]) == 0
    assert "in place of the run of " in capsys.readouterr().out.splitlines()[-1]


def test_a_run_without_a_vehicle_shows_its_outputs(dist, workplace, capsys):
    """Their first and last values, and a figure; `plot` takes the result without patterns."""
    planner = str(dist / "MotionPlanner.fmu")
    assert main(["run", planner, "--stop-time", "1", "--out", "out"]) == 0
    shown = capsys.readouterr().out
    table = read_csv("out/result.csv")
    name = "MotionPlanner.y_d.x"
    line = next(line for line in shown.splitlines() if name in line)
    assert tells(line.partition("]")[2], [round(float(table[name][i]), 4) for i in (0, -1)])
    assert Path("out/MotionPlanner.png").is_file()
    assert main(["plot", "out"]) == 0 and Path("plot.png").is_file()


def test_same_run_gives_the_same_files(workplace):
    for name in ("a", "b"):
        assert main(["run", "fig4", "--stop-time", "0.2", "--out", name]) == 0
    for path in (workplace / "a").iterdir():
        # The record contains the time and the command.
        if path.name not in ("run.json", LEDGER):
            assert path.read_bytes() == (workplace / "b" / path.name).read_bytes(), path.name


def test_own_scenario_file_and_ssp_run_the_same_way(dist, workplace):
    """A component of the user's takes the place of another."""
    shutil.copy(dist / "PdController.fmu", "mine.fmu")
    (workplace / "mine.toml").write_text(
        'title = "Mine"\nstop_time = 0.2\n[components]\ncontroller = "mine.fmu"\n'
        '[wires]\n"controller.dy" = "plant.dy"\n'
        '[parameters]\nplant.noise.std = 0.0\n"controller.K1[1]" = 12.0\n'
    )
    assert main(["run", "mine.toml", "--no-figures"]) == 0
    folder = workplace / "results" / "mine"
    values = json.loads((folder / "metrics.json").read_text())
    assert values["parameters"] == {"controller.K1[1]": 12.0, "plant.noise.std": 0.0}
    header = (folder / "result.csv").read_text().splitlines()[0]
    assert "controller.dy.x" in header and "controller.y_hat.x" not in header
    archive = str(dist / "auv.ssp")
    assert main(["run", archive, "--stop-time", "0.2", "--no-figures", "--out", "from_ssp"]) == 0
    assert (workplace / "from_ssp" / "result.csv").is_file()


def test_comparison_runs_both_and_changes_both_where_both_have_it(workplace):
    """Reference and stop time of an edited copy also apply to the companion."""
    text = (SCENARIOS / "fig5.toml").read_text()
    copy = text.replace("-30.0", "-60.0").replace("stop_time = 100.0", "stop_time = 0.2")
    (workplace / "mine.toml").write_text(copy)
    changes = ["--set", "plant.m11=26", "--set", "controller.k_d=40"]
    assert main(["run", "mine.toml", *changes]) == 0
    folder = workplace / "results" / "mine"
    assert {"mine.png", "mine.svg", "certificates.csv", "fig5-pd"} <= files(folder)
    proposed = json.loads((folder / "metrics.json").read_text())
    pd = json.loads((folder / "fig5-pd" / "metrics.json").read_text())
    assert proposed["parameters"]["controller.k_d"] == 40.0
    assert proposed["parameters"]["plant.m11"] == pd["parameters"]["plant.m11"] == 26.0
    assert proposed["velocities_reaching_controller"] == []
    assert pd["velocities_reaching_controller"] == ["plant.dy.x", "plant.dy.y", "plant.dy.z"]
    assert (pd["parameters"]["planner.eta0.z"], pd["stop_time"]) == (-60.0, 0.2)


@pytest.mark.parametrize("name", ["fig3a", *slow("fig3b", "fig6")])
def test_figures_of_other_kinds_are_drawn(workplace, name):
    assert main(["run", name, "--stop-time", "0.2"]) == 0
    assert {f"{name}.png", f"{name}.svg"} <= files(workplace / "results" / name)


def test_gains_prints_both_sides_and_the_verdicts(workplace, capsys):
    assert main(["gains"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("2 of the 3 conditions of Theorem 1 are violated, 1 is open: ")
    assert "10 > 15: violated" in shown
    assert tells(shown, [191.7], (-5, 0, -161.7, 958.8))
    assert mentions(shown, "R_A paper's")
    assert main(["gains", "--set", "controller.lambda=3"]) == 0
    shown = capsys.readouterr().out
    assert "30 > 25: met" in shown
    assert "paper's" not in shown
    # Theorem 2 weighs K_1 with s'_M = 2 / pi: 20 / pi + 5 is 11.3662.
    assert main(["gains", "--set", "controller.saturation=arctan"]) == 0
    shown = capsys.readouterr().out
    assert tells(shown, (30, 11.3662)) and "conditions of Theorem 2" in shown.splitlines()[0]


@pytest.mark.parametrize("scenario", ["fig4", "formation-v", *slow("path", "remus-pd", "sea")])
def test_a_scenario_is_exported_and_runs_from_its_ssp(workplace, scenario):
    """The same rows from the export as from the scenario itself."""
    assert main(["export", scenario]) == 0
    folder = workplace / "exports" / scenario
    plant = "Remus100.fmu" if scenario.startswith("remus") else "AuvPlant.fmu"
    # libcosim cannot choose the shape of a formation.
    has_choices = "shape" in str(load(scenario).changed("Enumeration"))
    assert main(["export", scenario, "--format", "osp"]) == (2 if has_choices else 0)
    osp = set() if has_choices else {"OspSystemStructure.xml", plant}
    assert {f"{scenario}.ssp", *osp} <= files(folder)
    archive = str(folder / f"{scenario}.ssp")
    how = ("--stop-time", "0.5", "--no-figures")
    assert main(["run", scenario, *how, "--out", "direct"]) == 0
    assert main(["run", archive, *how, "--out", "exported"]) == 0
    direct, exported = (Path(name, "result.csv").read_text() for name in ("direct", "exported"))
    assert exported == direct


@pytest.mark.slow
def test_animation_of_a_failed_run_says_so(workplace, capsys):
    arguments = ["animate", "fig4", "--set", "plant.d11=1e4", "--out", "failed.gif"]
    assert main(arguments) == 1
    assert "stopped at t =" in capsys.readouterr().err


def test_failed_simulation_is_status_1_and_keeps_its_rows(workplace, capsys):
    arguments = ["run", "fig4", "--set", "plant.d11=1e4", "--no-figures", "--out", "failed"]
    assert main(arguments) == 1
    shown = capsys.readouterr()
    assert "stopped at t =" in shown.err
    values = json.loads((workplace / "failed/metrics.json").read_text())
    assert "stopped at t =" in values["failure"]
    assert f"only the first {values['stop_time']:g} s" in shown.out
    assert "at the end" not in shown.out
    assert len((workplace / "failed/result.csv").read_text().splitlines()) > 10


def test_command_is_installed(workplace):
    command = Path(sys.executable).with_name("auv-fmu")
    shown = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert shown.stdout.strip()


#: Runs the command line, and prints which of some modules it has imported.
_IMPORTED = """
import sys
from contextlib import suppress
from orchestrator.commands.main import main
*arguments, unwanted = sys.argv[1:]
with suppress(SystemExit):
    main(arguments)
print(sorted(sys.modules.keys() & {*unwanted.split(",")}), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("arguments", "unwanted"),
    [
        ("run fig4 --kind native --no-figures --stop-time 0.1", "matplotlib"),
        ("check PdController.fmu", "matplotlib,pydantic"),
        ("list", "fmpy,matplotlib,numpy,pydantic"),
        *slow(
            ("check study.toml", "matplotlib"),
            ("--help", "fmpy,matplotlib,numpy,pydantic"),
        ),
    ],
)
def test_commands_do_not_wait_for_what_they_do_not_need(native, workplace, arguments, unwanted):
    shutil.copy(native / "PdController.fmu", workplace)
    shutil.copy(STUDIES / "attraction.toml", "study.toml")
    process = subprocess.run(
        [sys.executable, "-c", _IMPORTED, *arguments.split(), unwanted],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert process.stderr == "[]\n"
