"""docs/events.md: examples that run, and the sentences of the scenarios that it shows."""

from __future__ import annotations

import pytest

from orchestrator.commands.main import main
from orchestrator.runs.scenario import read_scenario
from support.markdown import DOCS, blocks

PAGE = DOCS / "events.md"
EXAMPLES = [block.text for block in blocks(PAGE, "toml")]


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_example_runs(example, workplace):
    [table] = [text for _, text in blocks(PAGE, "text") if text.startswith("time")]
    (workplace / "inputs.csv").write_text(table)
    (workplace / "mine.toml").write_text(example)
    assert main(["run", "mine.toml", "--stop-time", "3", "--kind", "native"]) == 0


def test_python_runs(capsys):
    [example] = blocks(PAGE, "python")
    exec(compile(example.text, "events.md", "exec"), {})
    assert capsys.readouterr().out.splitlines() == [
        "10.0 lose controller.tau.r",
        "15.0 lose controller.tau.r, ended",
        "20.0 set plant.current.x = 0.3",
    ]


@pytest.mark.parametrize("name", ["fault-thruster", "fault-sensor", "current-step"])
def test_what_a_scenario_says_stands_on_the_page(name):
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    assert " ".join(read_scenario(name).remark.split()) in text
