"""docs/scenarios.md: its examples run and are drawn."""

from __future__ import annotations

import json

import pytest

from orchestrator.commands.main import main
from support.markdown import DOCS, blocks

PAGE = DOCS / "scenarios.md"
EXAMPLES = [block.text for block in blocks(PAGE, "toml")]


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_example_runs_and_is_drawn(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "survey.csv").write_text("x,y,z\n3,6,0\n15,6,4\n15,10,4\n")
    (tmp_path / "mine.toml").write_text(example)
    assert main(["run", "mine.toml", "--stop-time", "2"]) == 0
    folder = tmp_path / "results/mine"
    assert list(folder.glob("mine*.png"))
    assert json.loads((folder / "metrics.json").read_text())["stop_time"] == 2.0
