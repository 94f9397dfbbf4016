"""Files of the user's in the folders of the program."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.runs.tables import read_rows
from support.machine import contents
from support.texts import mentions

pytestmark = pytest.mark.usefixtures("workplace")

RUN = ["run", "fig3a", "--stop-time", "0.2", "--no-figures", "--out", "r"]


def put(*names: str) -> dict[str, bytes]:
    """Files of the user's."""
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(f"mine: {name}")
    return {name: f"mine: {name}".encode() for name in names}


def rows(path: str | Path) -> np.ndarray:
    return np.vstack(list(read_rows(Path(path))))


def test_a_folder_called_checkpoint_stays():
    mine = put("r/checkpoint/thesis.tex", "r/checkpoint/data/a.csv", "home/letter.txt", "note")
    assert main([*RUN, "--checkpoint-every", "0.1"]) == 0
    simulate("fig3a", stop_time=0.2, checkpoint="home", checkpoint_every=0.1)
    simulate("fig3a", stop_time=0.2, checkpoint=".", checkpoint_every=0.1)
    assert {name: content for name, content in contents(Path()).items() if name in mine} == mine
    assert {path.name for path in Path("r/checkpoint").iterdir()} == {"thesis.tex", "data"}


@pytest.mark.parametrize("stem", ["..", "incomplete", "checkpoint", "result.csv"])
def test_a_companion_of_any_name_has_a_folder_of_its_own(stem):
    mine = put("r/data.csv", "r/thesis/a.tex", "r/.git/HEAD", "letter")
    Path("both.toml").write_text(
        f'stop_time = 0.2\n[compare]\nname = "{stem}"\nparameters.plant.m11 = 26.0\n'
    )
    options = ["--set", "plant.noise.std=0", "--checkpoint-every", "0.1"]
    assert main(["run", "both.toml", "--no-figures", "--out", "r", *options]) == 0
    found = contents(Path())
    assert {name: found.get(name) for name in mine} == mine
    [record] = Path("r").glob("*/run.json")
    assert json.loads(record.read_text())["scenario"] == stem
    for path, mass in (("r/result.csv", {}), (record.with_name("result.csv"), {"plant.m11": 26.0})):
        made = simulate("fig4", {"plant.noise.std": 0.0, **mass}, stop_time=0.2)
        assert np.array_equal(rows(path), made.rows)


@pytest.mark.parametrize(
    "name", ["result.csv", "result.parquet", "run.json", "checkpoint/rows.bin"]
)
def test_a_file_that_no_run_wrote_is_refused_before_the_first_step(name, capsys):
    mine = put(f"r/{name}")
    Path("r", name).chmod(0o444)
    command = [*RUN, *(["--checkpoint-every", "0.1"] if "/" in name else [])]
    assert main(command) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert mentions(line, f"auv-fmu: r/{name} --force")
    assert contents(Path()) == mine
    assert main([*command, "--force"]) == 0
    assert Path(f"r/{name}.~1~").read_bytes() == mine[f"r/{name}"]


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("checkpoint", [*RUN, "--checkpoint-every", "0.1"]),
        ("fig3b", ["run", "both.toml", "--no-figures", "--out", "r"]),
    ],
)
def test_a_folder_that_is_a_link_is_refused(name, command, capsys):
    """It may lead out of the folder."""
    mine = put("home/letter", "r/notes")
    Path("both.toml").write_text('compare = { name = "fig3b" }\nstop_time = 0.2\n')
    Path("r", name).symlink_to("../home")
    assert main(command) == 2
    assert f"r/{name}" in capsys.readouterr().err
    found = contents(Path())
    assert {k: found[k] for k in found if k.startswith(("home", "r"))} == mine
