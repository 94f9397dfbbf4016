"""ready-studies.md: as the studies' files say, with a picture for each figure and no other."""

from __future__ import annotations

import re
from importlib import import_module

import pytest
from PIL import Image

from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.scenario import names
from orchestrator.studies.study import read_study, ready_studies
from orchestrator.vehicle.indices import index_columns
from orchestrator.vehicle.signals import loops_of
from pages import PICTURES, SMALL, SMALL_STUDIES
from support.markdown import DOCS

PAGE = DOCS / "explanation" / "ready-studies.md"


def test_every_picture_is_on_the_page_in_all_its_colours_and_small():
    named = set(re.findall(r"\(../(images/[^)]+)\)", PAGE.read_text(encoding="utf-8")))
    files = [*(DOCS / PICTURES / "studies").iterdir()]
    assert named == {file.relative_to(DOCS).as_posix() for file in files}
    assert all(file.stat().st_size < 300_000 for file in files)
    # A palette takes colours out of their scales.
    modes = {Image.open(file).mode for file in files}
    assert modes == {"RGB"}, "run tools/pictures.py"


def test_every_scenario_has_a_picture_and_nothing_else_has():
    files = [*(DOCS / PICTURES).glob("*.png")]
    assert {file.stem for file in files} == {*names(), "benchmark"}
    assert all(file.stat().st_size < 150_000 for file in files)


def test_gallery_has_a_small_picture_of_every_scenario_and_study():
    small = DOCS / PICTURES / SMALL
    files = {file.relative_to(small).as_posix() for file in small.rglob("*.*")}
    of_studies = {f"studies/{name}-{SMALL_STUDIES[name]}.png" for name in ready_studies()}
    assert files == of_studies | {f"{name}.png" for name in names()}
    assert all((small / file).stat().st_size < 80_000 for file in files)


@pytest.mark.parametrize("name", ready_studies())
def test_numbers_are_read_off_columns_that_runs_have(name):
    pandas = pytest.importorskip("pandas", reason="needs the extra `docs`")
    pytest.importorskip("scipy", reason="needs the extra `studies`")
    tool = import_module("page_numbers")
    study = read_study(name)
    _, system = load_scenario(study.scenario[0])
    row = dict.fromkeys((*study.varied, *index_columns(loops_of(system))), 1.0) | {
        "scenario": "fig5",
        "failure": "",
    }
    row |= {key: values[0] for key, values in study.vary.items()}
    runs = tool.prepared(name, pandas.DataFrame([{"run": 0, **row}]))
    for statistic, columns, by, where in map(tool.parsed, tool.lines_of(name)):
        assert statistic in tool.STATISTICS
        assert {column.removeprefix("tenth_") for column in (*columns, *by)} <= {*runs}
        assert not where or runs.query(where) is not None
