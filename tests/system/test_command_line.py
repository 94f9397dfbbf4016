"""`auv-fmu` as a user types it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from fmpy.util import read_csv

from orchestrator.commands.main import main
from orchestrator.machine.cache import users_folder
from orchestrator.machine.ledger import LEDGER
from orchestrator.runs import bundle
from orchestrator.runs.scenario import FOLDER as SCENARIOS
from orchestrator.runs.scenario import names, read_scenario
from support.texts import mentions, tells


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.name != LEDGER}


def test_build_writes_every_fmu_and_the_bundle_once(workplace, capsys):
    assert main(["build", "--out", "elsewhere"]) == 0
    assert {"AuvPlant.fmu", "ObserverController.fmu", "auv.ssp"} <= files(workplace / "elsewhere")
    before = {p: p.stat().st_mtime_ns for p in (workplace / "elsewhere").iterdir()}
    capsys.readouterr()
    assert main(["build", "--out", "elsewhere"]) == 0
    assert "up to date" in capsys.readouterr().out
    assert {p: p.stat().st_mtime_ns for p in (workplace / "elsewhere").iterdir()} == before


def test_build_replaces_what_is_missing_or_stale(dist, workplace):
    shutil.copytree(dist, workplace / "bundle")
    stale = workplace / "bundle/build.json"
    stale.write_text('{"fingerprint": "of other sources"}')
    (workplace / "bundle/AuvPlant.fmu").unlink()
    assert main(["build", "--out", "bundle"]) == 2
    assert "other" in stale.read_text()
    assert main(["build", "--out", "bundle", "--force"]) == 0
    assert (workplace / "bundle/AuvPlant.fmu").is_file()
    assert "other" not in stale.read_text()


def test_build_takes_a_manifest_that_is_none_for_none(dist, workplace):
    shutil.copytree(dist, workplace / "bundle")
    manifest = workplace / "bundle/build.json"
    whole = manifest.read_text()
    manifest.write_text("[]")
    assert main(["build", "--out", "bundle", "--force"]) == 0
    assert manifest.read_text() == whole


def test_build_replaces_fmus_that_are_not_what_was_built(dist, workplace):
    shutil.copytree(dist, workplace / "bundle")
    cut, other = (workplace / "bundle" / name for name in ("AuvPlant.fmu", "PdController.fmu"))
    cut.write_bytes(cut.read_bytes()[:1000])
    os.utime(cut, ns=(0, 0))
    untouched = other.stat().st_mtime_ns
    assert main(["build", "--out", "bundle"]) == 2
    assert main(["build", "--out", "bundle", "--force"]) == 0
    assert cut.read_bytes() == (dist / "AuvPlant.fmu").read_bytes()
    assert other.stat().st_mtime_ns == untouched


def test_run_replaces_a_cached_fmu_that_is_not_what_was_built(workplace, monkeypatch):
    bundle.current_fmus()
    # Other tests read the one that all share.
    cache = shutil.copytree(users_folder(), workplace / "cache" / users_folder().name)
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache.parent))
    bundle.current_fmus.cache_clear()
    try:
        fmu = bundle.current_fmus() / "AuvPlant.fmu"
        whole = fmu.read_bytes()
        fmu.write_bytes(whole[:1000])
        bundle.current_fmus.cache_clear()
        assert main(["run", "fig4", "--stop-time", "0.1", "--no-figures"]) == 0
        assert (bundle.current_fmus() / "AuvPlant.fmu").read_bytes() == whole
        # Whatever that is, it is not ours to overwrite.
        assert fmu.read_bytes() == whole[:1000]
    finally:
        bundle.current_fmus.cache_clear()


def test_run_writes_into_its_folder_alone(workplace):
    assert main(["run", "fig4", "--stop-time", "0.1"]) == 0
    assert files(workplace) == {"results"}
    assert files(workplace / "results") == {"fig4"}


def test_list_names_the_scenarios(capsys):
    assert main(["list"]) == 0
    assert "fig4 " in capsys.readouterr().out


def test_run_writes_table_metrics_and_figures(workplace, capsys):
    assert main(["run", "fig4", "--stop-time", "2", "--set", "plant.noise.std=0"]) == 0
    folder = workplace / "results" / "fig4"
    figures = {f"{stem}.{end}" for stem in ("fig4", "fig4-velocity") for end in ("png", "svg")}
    tables = {"result.csv", "metrics.json", "certificates.csv", "run.json"}
    assert files(folder) == tables | figures
    table = read_csv(folder / "result.csv")
    assert table.dtype.names[0] == "time"
    assert len(table) == 101
    values = json.loads((folder / "metrics.json").read_text())
    assert values["scenario"] == "fig4"
    assert values["parameters"] == {"plant.noise.std": 0.0}
    assert (values["stop_time"], values["step"], values["order"]) == (2.0, 0.02, "gauss-seidel")
    for key in ("l2_effort", "rms_effort", "peak_command", "saturated_fraction",
                "total_variation", "final_error"):  # fmt: skip
        assert len(values[key]) == 3
    assert "written to" in capsys.readouterr().out


def test_same_run_gives_the_same_files(workplace):
    for name in ("a", "b"):
        assert main(["run", "fig4", "--stop-time", "1", "--out", name]) == 0
    for path in (workplace / "a").iterdir():
        # The record says when and with which command.
        if path.name not in ("run.json", LEDGER):
            assert path.read_bytes() == (workplace / "b" / path.name).read_bytes(), path.name


def test_own_scenario_file_and_ssp_run_the_same_way(dist, workplace):
    (workplace / "mine.toml").write_text(
        'title = "Mine"\nstop_time = 0.2\n[parameters]\nplant.noise.std = 0.0\n'
        '"controller.K1[1]" = 12.0\n'
    )
    assert main(["run", "mine.toml"]) == 0
    values = json.loads((workplace / "results/mine/metrics.json").read_text())
    assert values["parameters"] == {"controller.K1[1]": 12.0, "plant.noise.std": 0.0}
    archive = str(dist / "auv.ssp")
    assert main(["run", archive, "--stop-time", "0.2", "--out", "from_ssp"]) == 0
    assert (workplace / "from_ssp" / "result.csv").is_file()


def test_comparison_runs_both_and_changes_both_where_both_have_it(workplace):
    arguments = ["run", "fig5", "--stop-time", "1", "--set", "plant.m11=26", "--set",
                 "controller.k_d=40"]  # fmt: skip
    assert main(arguments) == 0
    folder = workplace / "results" / "fig5"
    assert {"fig5.png", "fig5.svg", "certificates.csv", "fig5-pd"} <= files(folder)
    proposed = json.loads((folder / "metrics.json").read_text())
    pd = json.loads((folder / "fig5-pd" / "metrics.json").read_text())
    assert proposed["parameters"]["controller.k_d"] == 40.0
    assert proposed["parameters"]["plant.m11"] == pd["parameters"]["plant.m11"] == 26.0
    assert proposed["velocities_reaching_controller"] == []
    assert pd["velocities_reaching_controller"] == ["plant.dy.x", "plant.dy.y", "plant.dy.z"]


def test_own_component_takes_the_place_of_another(dist, workplace):
    shutil.copy(dist / "PdController.fmu", "mine.fmu")
    (workplace / "mine.toml").write_text(
        'stop_time = 0.2\n[components]\ncontroller = "mine.fmu"\n'
        '[wires]\n"controller.dy" = "plant.dy"\n'
    )
    assert main(["run", "mine.toml"]) == 0
    header = (workplace / "results/mine/result.csv").read_text().splitlines()[0]
    assert "controller.dy.x" in header
    assert "controller.y_hat.x" not in header


@pytest.mark.parametrize("name", ["fig3a", "fig3b", "fig6"])
def test_figures_of_other_kinds_are_drawn(workplace, name):
    assert main(["run", name, "--stop-time", "1"]) == 0
    assert {f"{name}.png", f"{name}.svg"} <= files(workplace / "results" / name)


def test_gains_prints_both_sides_and_the_verdicts(workplace, capsys):
    assert main(["gains"]) == 0
    shown = capsys.readouterr().out
    assert "10 > 15: violated" in shown
    assert tells(shown, [191.7], (-5, 0, -161.7, 958.8))

    assert "R_A is empty" in shown
    assert "the paper's own gains" in shown
    assert main(["gains", "--set", "controller.lambda=3"]) == 0
    shown = capsys.readouterr().out
    assert "30 > 25: met" in shown
    assert "paper's own gains" not in shown
    # Theorem 2 weighs K_1 with s'_M = 2 / pi: 20 / pi + 5 is 11.3662.
    assert main(["gains", "--set", "controller.saturation=arctan"]) == 0
    assert tells(capsys.readouterr().out, (30, 11.3662))


def test_edited_copy_of_a_comparison_compares_like_with_like(workplace):
    """Reference and stop time of the copy go for the companion as well."""
    text = (SCENARIOS / "fig5.toml").read_text()
    copy = text.replace("-30.0", "-60.0").replace("stop_time = 100.0", "stop_time = 0.5")
    (workplace / "mine.toml").write_text(copy)
    assert main(["run", "mine.toml"]) == 0
    companion = json.loads((workplace / "results/mine/fig5-pd/metrics.json").read_text())
    assert companion["parameters"]["planner.eta0.z"] == -60.0
    assert companion["stop_time"] == 0.5


def test_title_is_text_and_no_formula(workplace):
    (workplace / "odd.toml").write_text("title = 'costs $x^{$'\nstop_time = 0.1")
    assert main(["run", "odd.toml"]) == 0


def test_inputs_that_were_set_are_on_record(workplace):
    assert main(["run", "fig3a", "--stop-time", "0.1"]) == 0
    values = json.loads((workplace / "results/fig3a/metrics.json").read_text())
    assert values["parameters"]["plant.tau.u"] == 10.0


@pytest.mark.parametrize("scenario", [name for name in names() if not read_scenario(name).events])
def test_every_scenario_is_exported_and_runs_from_its_ssp(workplace, scenario):
    """The same rows from the export as from the scenario itself."""
    assert main(["export", scenario]) == 0
    assert main(["export", scenario, "--format", "osp"]) == 0
    folder = workplace / "exports" / scenario
    assert {f"{scenario}.ssp", "OspSystemStructure.xml", "AuvPlant.fmu"} <= files(folder)
    archive = str(folder / f"{scenario}.ssp")
    how = ("--stop-time", "0.5", "--no-figures")
    assert main(["run", scenario, *how, "--out", "direct"]) == 0
    assert main(["run", archive, *how, "--out", "exported"]) == 0
    direct, exported = (Path(name, "result.csv").read_text() for name in ("direct", "exported"))
    assert exported == direct


def test_animation_of_a_failed_run_says_so(workplace, capsys):
    arguments = ["animate", "fig4", "--set", "plant.d11=1e4", "--out", "failed.gif"]
    assert main(arguments) == 1
    assert "stopped at t =" in capsys.readouterr().err


def test_animation_is_written(workplace):
    assert main(["animate", "fig4", "--stop-time", "1", "--out", "films/fig4.gif"]) == 0
    assert (workplace / "films/fig4.gif").read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["run", "fig99"], "'fig99'; fig4"),
        (["run", "missing.ssp"], "missing.ssp"),
        (["run", "fig4", "--set", "plant.m11"], "COMPONENT.PARAMETER=VALUE"),
        (["run", "fig4", "--set", "m11=3"], "component.port"),
        (["run", "fig4", "--set", "plant.m11=nan"], "finite"),
        (["run", "fig4", "--set", "plant.mass=3"], "plant 'mass'"),
        (["run", "fig4", "--step", "-1"], "positive"),
        (["run", "fig4", "--stop-time", "0"], "positive"),
        (["run", "broken.toml"], "broken.toml"),
        (["run", "unknown.toml"], "'stop_tme'"),
        (["run", "wrong.toml"], "type"),
        (["run", "figure.toml"], "'none'"),
        (["run", "broken.ssp"], "broken.ssp"),
        (["run", "fig4", "--out", "file/below"], "--out"),
        (["run", "fig4", "--out", ""], "--out"),
        (["run", "fig4", "--order", ""], "--order"),
        (["run", "fig4", "--order="], "--order="),
        (["plot", ""], "plot"),
        (["build", "--out", "file/below"], "file/below"),
        (["run", "wire.toml"], "controller dy dy.*"),
        (["run", "wires.toml"], "wires"),
        (["run", "only.toml"], "pilot"),
        (["run", "bool.toml"], "type"),
        (["run", "compare.toml"], "'nosuch'"),
        (["run", "fig4", "--stop-time", "1e300"], "steps"),
        (["run", "fig4", "--step", "1e-300"], "steps"),
        (["run", "fig4", "--set", "plant.noise.seed=4294967297"], "plant.noise.seed"),
        (["run", "fig4", "--set", "controller.K1=20"], "K1[1]"),
        (["run", "fig4", "--interval", "0"], "positive"),
        (["run", "named.toml"], "a.b"),
        (["verify", "broken.ssp", "--tolerance", "nan"], "tolerance"),
        (["run", "fig4", "--columns", "plant.tua.*"], "plant.tua.*"),
        (["run", "unwired.toml"], "'plant.tua' plant.tau"),
        (["run", "fig4", "--stop-time", "0.1", "--out", "taken"], "taken/result.csv"),
        (["gains", "--set", "plant.ell=0"], "plant.ell"),
        (["gains", "--set", "controller.K1[1]=nan"], "finite"),
        (["run", "missing.toml"], "missing.fmu"),
        (["gains", "--set", "controller.lambda=much"], "real"),
        (["gains", "--set", "controller.saturation=sigmoid"], "tanh, algebraic"),
        (["animate", "fig4", "--stop-time", "0.1", "--out", "film.avi"], ".gif"),
        (["run", "digits.toml"], "1e308"),
        (["run", "more_digits.toml"], "more_digits.toml limit"),
        (["run", "parameter.toml"], "real"),
        (["run", "infinite.toml"], "finite"),
        (["run", "arrays.toml"], "nested"),
        (["run", "keys.toml"], "nested"),
        (["run", "list.toml"], "[[[[[[[[[[[[["),
        (["run", "zero.toml"], "UTF-8"),
        (["run", "fig4", "--set", "plant.noise.seed=1_0"], "integer"),
        (["run", "fig4", "--set", "plant.m11=\u0662"], "real"),
    ],
)
def test_bad_input_is_one_line_and_status_2(workplace, capsys, arguments, reason):
    (workplace / "digits.toml").write_text(f"stop_time = {'9' * 400}")
    (workplace / "more_digits.toml").write_text(f"stop_time = {'9' * 5000}")
    (workplace / "parameter.toml").write_text(f"parameters.plant.m11 = 0x{'f' * 5000}")
    (workplace / "infinite.toml").write_text(f"parameters.plant.m11 = {'9' * 400}")
    (workplace / "arrays.toml").write_text(f"only = {'[' * 5000}{']' * 5000}")
    (workplace / "keys.toml").write_text(f"parameters.{'.'.join('a' * 2000)} = 1")
    (workplace / "list.toml").write_text(f"stop_time = {'[' * 50}{']' * 50}")
    (workplace / "zero.toml").write_text('parameters.controller.saturation = "tanh\\u0000x"')
    (workplace / "broken.toml").write_text("stop_time = ")
    (workplace / "unknown.toml").write_text("stop_tme = 3")
    (workplace / "wrong.toml").write_text("stop_time = 'long'")
    (workplace / "figure.toml").write_text("figure = 'none'")
    (workplace / "broken.ssp").write_bytes(b"no archive")
    (workplace / "file").write_text("in the way")
    (workplace / "wire.toml").write_text('[wires]\n"controller.dy" = "plant.dy"')
    (workplace / "wires.toml").write_text('[wires]\n"plant.tau" = 5')
    (workplace / "only.toml").write_text('only = ["pilot"]')
    (workplace / "bool.toml").write_text("stop_time = true")
    (workplace / "named.toml").write_text('[components]\n"a.b" = "AuvPlant"')
    (workplace / "unwired.toml").write_text('[wires]\n"plant.tua" = false')
    (workplace / "compare.toml").write_text('stop_time = 0.1\ncompare = "nosuch"')
    (workplace / "taken" / "result.csv").mkdir(parents=True)
    (workplace / "missing.toml").write_text('[components]\ncontroller = "missing.fmu"')
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert mentions(error, reason)
    assert error.count("\n") == 1
    assert error.startswith("auv-fmu: ")


def test_bad_usage_is_status_2():
    assert main(["run", "fig4", "--order", "random"]) == 2
    with pytest.raises(SystemExit) as stop:
        main(["run", "fig4", "--kind", "random"])
    assert stop.value.code == 2


def test_failed_simulation_is_status_1_and_keeps_its_rows(workplace, capsys):
    arguments = ["run", "fig4", "--set", "plant.d11=1e4", "--out", "failed"]
    assert main(arguments) == 1
    assert "stopped at t =" in capsys.readouterr().err
    values = json.loads((workplace / "failed/metrics.json").read_text())
    assert "stopped at t =" in values["failure"]
    assert len((workplace / "failed/result.csv").read_text().splitlines()) > 10


def test_command_is_installed(workplace):
    command = Path(sys.executable).with_name("auv-fmu")
    shown = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert shown.stdout.strip()
