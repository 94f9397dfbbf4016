"""`auv-fmu sweep` and `orchestrator.sweep`: studies from their files to their tables."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator import sweep
from orchestrator.commands.main import main
from orchestrator.experiments.preparation import loaded
from orchestrator.studies.engine import INDICES
from orchestrator.studies.fmu_engine import FmuEngine
from orchestrator.studies.space import Space
from orchestrator.studies.study import read_study
from support.machine import contents

pytest.importorskip("distributed", reason="needs Dask: the extra `studies`")

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


def straight(path: Path) -> list[Any]:
    """The outcomes of all runs, made one after the other in this process."""
    study = read_study(str(path))
    systems = {name: loaded(name, "native") for name in study.scenario}
    space = Space(study, systems)
    engine = FmuEngine({name: system for name, (_, system) in systems.items()})
    return list(engine.outcomes([space[i] for i in range(len(space))]))


def check(result: Any, outcomes: list[Any]) -> None:
    """That a table has these outcomes, one a run, in their order."""
    assert list(result["run"]) == list(range(len(outcomes)))
    assert list(result["failure"]) == [outcome.failure for outcome in outcomes]
    for name in INDICES:
        expected = [outcome.indices.get(name, np.nan) for outcome in outcomes]
        assert np.array_equal(result[name], expected, equal_nan=True), name


def test_command_makes_what_is_missing_and_nothing_twice(study, capfd):
    command = ["sweep", "mine.toml", "--kind", "native", "--workers", "1"]
    assert main(command) == 0
    folder = study.parent / "results" / "mine"
    out, err = capfd.readouterr()
    assert out.splitlines() == ["mine: 8 runs, of which 0 failed", "written to results/mine/"]
    assert err == ""
    before = files(folder)
    assert {"runs.parquet", "study.json"} < before.keys()
    assert not [name for name in before if name.startswith(".") or "sqlite" in name]
    result = sweep("mine.toml", kind="native")
    check(result, straight(study))
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
    err = capfd.readouterr().err.splitlines()
    assert [line.split("; ")[0] for line in err] == [
        "auv-fmu: results/mine holds another study, which differs in version",
        "auv-fmu: results/mine holds another study, which differs in vary, points",
    ]
    assert files(folder)["runs.parquet"] == before["runs.parquet"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing"], "no study 'nothing'"),
        (["mine.toml", "--workers", "0"], "--workers 0: must be at least 1"),
        (["mine.toml", "--scheduler", "nowhere"], "nowhere"),
        (["mine.toml", "--out", "mine.toml"], "cannot write into mine.toml"),
    ],
)
def test_what_cannot_be_done_is_one_line(study, capfd, arguments, words):
    assert main(["sweep", *arguments, "--kind", "native"]) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert words in line
