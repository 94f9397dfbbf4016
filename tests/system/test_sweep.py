"""`auv-fmu sweep` and `orchestrator.sweep`: studies from their files to their tables."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import chain, product
from pathlib import Path

import numpy as np
import pytest

from orchestrator import sweep
from orchestrator.commands.main import main
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.scenario import Scenario
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import FmuEngine
from orchestrator.studies.space import Space
from orchestrator.studies.study import BATCH, FMU, read_study, study_of
from orchestrator.studies.sweep import Means, faster
from orchestrator.vehicle.indices import index_columns
from support import others
from support.machine import contents
from support.texts import mentions, tells
from support.tiers import slow

pytest.importorskip("pyarrow", reason="needs the extra `studies`")

STUDY = """
title = "Two starts"
scenario = ["fig5", "fig5-pd"]
stop_time = 1.0
[vary]
plant.eta0.y = [0.0, 4.0]
controller.saturation = ["tanh", "algebraic"]
"""


@pytest.fixture
def study(workplace: Path) -> Path:
    path = workplace / "mine.toml"
    path.write_text(STUDY)
    return path


def files(folder: Path) -> dict[str, int]:
    return {name: (folder / name).stat().st_mtime_ns for name in contents(folder)}


@pytest.mark.parametrize(
    ("scenario", "kind", "n", "option"),
    [
        ("fig5", "python", 100, "--engine batch"),
        ("fig5", "native", 2500, "--engine batch"),
        ("fig5", "python", 99, ""),
        ("fault-sensor", "python", 100, "--kind native"),
        ("fault-sensor", "native", 100, ""),
    ],
)
def test_option_that_makes_many_runs_sooner_is_named(scenario, kind, n, option, monkeypatch):
    """The batch engine does not support events."""
    monkeypatch.setattr("orchestrator.studies.sweep.machines_compiler", lambda: "cc")
    runs = {"scenario": scenario, "vary": {"plant.eta0.y": {"from": 0, "to": 1, "n": n}}}
    space = Space(study_of("many", runs), {scenario: load_scenario(scenario, kind)})
    lines = faster(space, FmuEngine(space.prepared), Means(kind=kind))
    assert mentions(lines, f"{n:,} {kind} {option}") if option else lines == ""
    assert faster(space, BatchEngine({}), Means(kind=kind)) == ""


def test_command_makes_what_is_missing_and_nothing_twice(study, capfd):
    command = ["sweep", "mine.toml", "--kind", "native", "--workers", "1"]
    assert main(command) == 0
    folder = study.parent / "results" / "mine"
    out, err = capfd.readouterr()
    first, second = out.splitlines()
    assert tells(first, (8, 0)) and first.startswith("mine: ")
    assert second.endswith(" results/mine/")
    assert err == ""
    before = files(folder)
    assert {"runs.parquet", "study.json"} < before.keys()
    assert not [name for name in before if name.startswith(".") or "sqlite" in name]
    result = sweep("mine.toml", kind="native")
    runs = read_study("mine.toml")
    space = Space(runs, {name: load_scenario(name, "native") for name in runs.scenario})
    outcomes = [*chain(*FmuEngine(space.prepared).outcomes(space.points(np.arange(len(space)))))]
    assert list(result["run"]) == list(range(len(outcomes)))
    assert list(result["failure"]) == [outcome.failure for outcome in outcomes]
    for name in index_columns():
        expected = [outcome.indices.get(name, np.nan) for outcome in outcomes]
        assert np.array_equal(result[name], expected, equal_nan=True), name
    assert list(result["scenario"]) == ["fig5", "fig5-pd"] * 4
    assert list(result["plant.eta0.y"]) == [0.0] * 4 + [4.0] * 4
    assert list(result["controller.saturation"]) == ["tanh"] * 2 + ["algebraic"] * 2 + [
        "tanh", "tanh", "algebraic", "algebraic",
    ]  # fmt: skip
    assert files(folder)["runs.parquet"] == before["runs.parquet"]
    record = json.loads((folder / "study.json").read_text())
    assert record["command"][:2] == ["auv-fmu", "sweep"]
    assert (record["runs"], record["failed"], record["title"]) == (8, 0, "Two starts")
    # Anything else is another study.
    assert main([*command[:-2], "--kind", "python"]) == 2
    study.write_text(STUDY.replace("4.0]", "5.0]"))
    assert main(command) == 2
    study.write_text(STUDY.replace("[0.0, 4.0]", "{ from = 0.0, to = 4.0, n = 2 }"))
    assert main(command) == 0
    assert main([*command, "--points", "3"]) == 2
    assert main([*command, "--points", "0"]) == 2
    err = capfd.readouterr().err.splitlines()
    assert [line.split("; ")[0] for line in err] == [
        "auv-fmu: results/mine holds another study, which differs in the FMU of controller, "
        "the FMU of disturbance, the FMU of planner, the FMU of plant",
        "auv-fmu: results/mine holds another study, which differs in vary, points",
        "auv-fmu: results/mine holds another study, which differs in vary, points",
        "auv-fmu: --points 0: must be at least 1",
    ]
    assert files(folder)["runs.parquet"] == before["runs.parquet"]


def test_cautions_of_runs_are_in_the_table_and_counted_at_the_end(workplace, capsys):
    """In both engines; a single run prints the same kinds of warnings."""
    words = {"unstable": "unstable observer", "chatters": "chattering", "90 deg": "vertical passed"}
    values = {"controller.k_d": [50.0, 120.0], "controller.eps_t": [0.001, 1.0],
              "plant.roll": [False]}  # fmt: skip
    expected = []
    for chosen in product(*values.values()):
        sets = [f"--set={name}={value}" for name, value in zip(values, chosen, strict=True)]
        assert (
            main(["run", "fig5", "--stop-time", "10", "--no-figures", "--loop", "compiled", *sets])
            == 0
        )
        lines = capsys.readouterr().err.splitlines()
        text = "\n".join(line for line in lines if "warning: fig5: " in line)
        expected.append(", ".join(kind for word, kind in words.items() if word in text) or None)
    assert len({*expected}) == 3
    study = {"scenario": "fig5", "stop_time": 10.0, "vary": values}
    tables = [sweep(study, engine=engine, out=engine, workers=1) for engine in (FMU, BATCH)]
    for result in tables:
        assert list(result["caution"]) == expected
    Path("mine.toml").write_text(
        'scenario = "fig5"\nstop_time = 1.0\n[vary]\ncontroller.k_d = [50.0, 120.0]\n'
    )
    assert main(["sweep", "mine.toml", "--workers", "1"]) == 0
    [line] = capsys.readouterr().err.splitlines()
    assert tells(line, (1, 2)) and mentions(line, "warning: unstable observer k_d h_max")
    record = json.loads((workplace / "results" / "mine" / "study.json").read_text())
    assert record["cautions"] == {"unstable observer": 1}


def test_study_continues_with_its_first_kind(study):
    study.write_text('scenario = "fig5"\nstop_time = 0.1\nvary.plant.eta0.y = [0.0, 4.0]\n')
    sweep("mine.toml", kind="python", out="here", workers=1)
    before = files(Path("here"))["runs.parquet"]
    result = sweep("mine.toml", out="here", workers=1)
    assert files(Path("here"))["runs.parquet"] == before
    assert result.record["kind"] == "python"


OWN = """
scenario = "own.toml"
engine = "{}"
[vary]
plant.eta0.y = [0.0, 4.0]
"""

#: Scenarios, the difference from the first, and the batch engine's refusal, if it refuses.
CHANGES = {
    "stop_time = 2.0": ("stop_time", ""),
    "stop_time = 1.0\nstep = 0.01": ("step", ""),
    'stop_time = 1.0\norder = "jacobi"': ("order", ""),
    'stop_time = 1.0\n[components]\ncontroller = "PdController"\n[wires]\n'
    '"controller.dy" = "plant.dy"': ("the FMU of controller, what feeds controller.dy.x", ""),
    "stop_time = 1.0\n[steps]\ncontroller = 0.2": ("the step of controller", ""),
    'stop_time = 1.0\norder = ["plant", "disturbance", "planner", "controller"]': ("order", ""),
    'stop_time = 1.0\n[[events]]\nat = 0.5\nfreeze = "plant.y"': ("the events", "has events"),
}  # fmt: skip


@pytest.mark.parametrize("engine", [FMU, *slow(BATCH)])
def test_another_scenario_of_the_same_name_is_another_study(workplace, capfd, engine):
    """Nothing that decides the numbers may change between two rows."""
    (workplace / "mine.toml").write_text(OWN.format(engine))
    own, folder = workplace / "own.toml", workplace / "results" / "mine"
    own.write_text("stop_time = 1.0\n")
    command = ["sweep", "mine.toml", "--kind", "native", "--workers", "1"]
    assert main(command) == 0
    before = contents(folder)
    for change, (different, unknown) in CHANGES.items():
        own.write_text(change)
        capfd.readouterr()
        assert main(command) == 2, change
        [line] = capfd.readouterr().err.splitlines()
        words = unknown if engine == BATCH and unknown else f"which differs in {different}"
        assert words in line
        assert contents(folder) == before
    own.write_text("title = 'Another'\nstop_time = 1.0\n")
    assert main(command) == 0
    assert contents(folder)["runs.parquet"] == before["runs.parquet"]


def test_runs_have_the_steps_that_a_system_is_given_where_it_names_none(tmp_path):
    """The default steps of its FMUs, as in a single run."""
    named = ('guid="others">', 'guid="others"><DefaultExperiment stepSize="{}"/>')
    fmus = []
    for name, step in (("a", "0.1"), ("b", "0.2")):
        (tmp_path / name).mkdir()
        fmus.append(others.build(tmp_path / name, change=(named[0], named[1].format(step))))
    a, b = (others.system_of(fmu, name) for fmu, name in zip(fmus, "ab", strict=True))
    system = replace(a, components={**a.components, **b.components})
    study = study_of("mine", {"scenario": "own", "stop_time": 1.0})
    space = Space(study, {"own": (Scenario("own"), system)})
    assert space[0].step == 0.1
    assert space.prepared["own"].system.steps == {"a": 0.1, "b": 0.2}
    varied = study_of("mine", {"scenario": "own", "stop_time": 1.0, "vary": {"step": [0.05]}})
    assert not Space(varied, {"own": (Scenario("own"), system)}).prepared["own"].system.steps
