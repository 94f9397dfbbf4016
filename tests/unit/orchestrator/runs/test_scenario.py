"""Scenario files: what each entry becomes, and mistakes by name."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import ENTRIES, Scenario, names, read_scenario
from support.texts import mentions

TEXT = """
title = "Mine"
stop_time = 3
only = ["plant"]
compare = "other.toml"
[components]
controller = "own/mine.fmu"
plant = "AuvPlant"
[wires]
"plant.tau" = false
[parameters]
plant.noise.std = 0.0
"controller.K1[1]" = 12.0
[ours]
plant.noise.std = "no sensor"
"""


def read(folder: Path, text: str) -> Scenario:
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    return read_scenario(str(folder / "mine.toml"))


def test_entries_are_read_and_paths_are_relative_to_the_file(tmp_path: Path):
    found = read(tmp_path, TEXT)
    assert (found.name, found.stem, found.title, found.stop_time) == ("mine", "mine", "Mine", 3)
    assert found.compare == str(tmp_path / "other.toml")
    assert found.components == {
        "controller": str(tmp_path / "own/mine.fmu"), "plant": "AuvPlant",
    }  # fmt: skip
    assert found.wires == {"plant.tau": False}
    parameters = {str(name): value for name, value in found.parameters.items()}
    assert parameters == {"plant.noise.std": 0.0, "controller.K1[1]": 12.0}
    assert found.ours == {"plant.noise.std": "no sensor"}
    assert found.digest == sha256(TEXT.encode()).hexdigest()


def test_an_empty_file_is_the_closed_loop_as_it_is(tmp_path: Path):
    found = read(tmp_path, "")
    assert found == Scenario("mine", digest=sha256(b"").hexdigest())
    assert (found.legend, found.figure, found.stop_time) == ("mine", "tracking", None)


@pytest.mark.parametrize(
    ("text", "culprits"),
    [
        ("stop_tme = 1", "'stop_tme' stop_time"),
        ('stop_time = "long"', "stop_time 'long'"),
        ('only = "plant"', "only"),
        ('coupling = "loose"', "coupling 'loose'"),
        ("steps.plant = true", "steps"),
        ('[wires]\n"plant.tau" = true', "wires"),
        ("events = 1", "events"),
        ('[inputs]\nbetween = "linear"', "inputs file"),
        ("[path]", "path file"),
        ("[parameters]\nell = 1.0", "'ell'"),
        ("stop_time = ", "mine.toml"),
        ("title = 1\nlabel = 2", "title 1 more"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, culprits: str):
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert mentions(str(error.value), culprits), error.value


def test_unknown_names_are_refused_with_those_that_there_are():
    with pytest.raises(InputError, match="fig4"):
        read_scenario("fig44")
    assert "fig4" in names()


def test_every_entry_of_a_scenario_can_be_written():
    fields = set(Scenario.__dataclass_fields__) - {"name", "digest"}
    assert ENTRIES.keys() == fields | {"path"}
