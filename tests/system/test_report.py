"""The whole report, with runs of a second, and with scenarios of a stranger in it."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from PIL import Image

from orchestrator.paper.claims import CLAIMS
from orchestrator.paper.effects import EFFECTS
from orchestrator.paper.page import errata
from orchestrator.paper.report import write_report
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.proof import gain_check

pytestmark = pytest.mark.slow

STRANGER = """\
title = "Mine | <b>own</b>"
figure = "comparison-errors"
remark = "A remark with **marks**, see reading 3."

[components]
controller = "mine.fmu"

[parameters]
controller.k_d = 40.0

[ours]
controller.k_d = "all of it"
"""

SCENARIOS = ("fig3a", "fig4")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, dist: Path) -> Path:
    """A report of two figures, a stranger's scenario, and one whose FMU is not there."""
    theirs = tmp_path_factory.mktemp("theirs")
    shutil.copy(dist / "ObserverController.fmu", theirs / "mine.fmu")
    (theirs / "stranger.toml").write_text(STRANGER)
    (theirs / "lost.toml").write_text(STRANGER.replace("mine.fmu", "lost.fmu"))
    report = tmp_path_factory.mktemp("report")
    files = [str(theirs / f"{name}.toml") for name in ("stranger", "lost")]
    write_report(report, [*SCENARIOS, *files], ["auv-fmu", "report"], stop_time=1.0)
    return report


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    return (folder / "report.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


def test_every_claim_has_a_row_and_every_effect_a_section(text):
    for claim in CLAIMS:
        assert f"\n| {claim.title.split(', reading')[0]}" in text
    for effect in EFFECTS:
        assert f"\n### {effect.title}\n" in text
        assert f"](figures/{effect.name}.png)" in text


def test_the_verdicts_are_counted(text):
    """From the table itself: its fourth column."""
    [line] = re.findall(
        r"^Of (\d+) printed numbers and claims, (\d+) agree and (\d+) do not", text, re.M
    )
    section = text.split("## Every printed number and claim")[1].split("\n## ")[0]
    rows = [re.split(r"(?<!\\)\|", row) for row in section.splitlines() if row.startswith("|")]
    verdicts = [row[4].strip() for row in rows[2:]]
    agree = [verdict for verdict in verdicts if verdict.startswith("agrees")]
    found = len(verdicts), len(agree), sum(verdict.startswith("**") for verdict in verdicts)
    assert tuple(map(int, line)) == found
    assert text.split("\n\n")[1].startswith("Of ")


def test_pictures_are_small(folder, page):
    files = [*(folder / "figures").rglob("*.png")]
    assert files
    for file in files:
        with Image.open(file) as picture:
            assert picture.mode == "P" and picture.width > 1000
    assert len(page) < 8e6


def test_the_stranger_is_in_the_report(folder, text, page):
    assert "\n### Mine \\| \\<b\\>own\\</b\\>\n" in text
    assert ">Mine | &lt;b&gt;own&lt;/b&gt;</h3>" in page
    assert '<strong>marks</strong>, see reading <a href="#reading-3">3</a>' in page
    assert "- `controller.k_d = 40.0`: all of it" in text
    assert (folder / "figures" / "stranger" / "stranger.png").is_file()


def test_a_scenario_that_cannot_run_says_why_and_breaks_nothing(text):
    [reason] = re.findall(r"\*\*The run lost ended early:\*\* (.*)", text)
    assert "lost.fmu: no such file" in reason


def test_errata_and_the_gain_check_are_in_the_report(text, dist):
    titles = re.findall("^#### .+$", errata(), re.MULTILINE)
    assert len(titles) > 20
    assert all(f"\n{title}\n" in text for title in titles)
    assert gain_check(closed_loop(dist)) in text


def test_links_lead_somewhere_and_the_page_needs_no_other_file(folder, page):
    links = set(re.findall(r'href="([^"]+)"', page))
    assert {link[1:] for link in links if link[0] == "#"} <= set(re.findall(r' id="([^"]+)"', page))
    files = {link for link in links if link[0] != "#"}
    assert files
    assert all((folder / file).is_file() for file in files)
    sources = re.findall(r'src="([^"]+)"', page)
    assert len(sources) >= len(EFFECTS) + len(SCENARIOS) + 1
    assert all(source.startswith("data:image/png;base64,") for source in sources)


def test_the_record_names_runs_and_files(folder, text):
    record = json.loads((folder / "run.json").read_text())
    assert "auv-fmu run fig4 --stop-time 1" in record["runs"]
    assert len(record["runs"]) == len(set(record["runs"]))
    assert all(command in text for command in record["runs"])
    assert {"report.md", "report.html", "run.json"} < set(record["files"])
    assert record["versions"].keys() >= {"python", "auv-fmu", "numpy"}
