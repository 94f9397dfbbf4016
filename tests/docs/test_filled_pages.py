"""The committed files are the output of tools/pages.py."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from orchestrator import runs
from orchestrator.studies import study
from pages import files, filled_in
from support.markdown import DOCS, blocks

FILES = files()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(DOCS.parent).as_posix())
def test_file_is_what_the_code_says(path: Path):
    assert path.read_text(encoding="utf-8") == FILES[path], "run `python tools/pages.py`"


def test_a_place_and_a_value_without_the_other_are_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("a <!-- filled: x -->1<!-- / --> b\n")
    assert filled_in(page, {"x": "2"}) == "a <!-- filled: x -->2<!-- / --> b\n"
    for values in ({}, {"x": "2", "y": "3"}):
        with pytest.raises(ValueError, match=r"page\.md: [xy]$"):
            filled_in(page, values)


def validator(kind: str) -> Draft202012Validator:
    schema = json.loads((DOCS / "schemas" / f"{kind}.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def ready(kind: str) -> list[str]:
    """Files that come with the program, and files on the page."""
    folder = {"scenario": runs.SCENARIOS_FOLDER, "study": study.STUDIES_FOLDER}[kind]
    page = DOCS / {"scenario": "reference/scenario-files.md", "study": "how-to/studies.md"}[kind]
    files = [file.read_text(encoding="utf-8") for file in folder.glob("*.toml")]
    return [*files, *(block.text for block in blocks(page, "toml"))]


@pytest.mark.parametrize("kind", ["scenario", "study"])
def test_schema_takes_all_files_that_run(kind: str):
    files = ready(kind)
    assert len(files) > 6
    for text in files:
        validator(kind).validate(tomllib.loads(text))


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("scenario", "titel = ''"),
        ("scenario", "title = 3"),
        ("scenario", "coupling = 'solv'"),
        ("scenario", "inputs = {}"),
        ("scenario", "events = [{ at = 1.0, loose = 'plant.tau' }]"),
        ("scenario", "events = [{ at = 1.0, for = 0.0, lose = 'plant.tau' }]"),
        ("scenario", "wires = { 'plant.tau' = true }"),
        ("study", "title = 'without a scenario'"),
        ("study", "scenario = []"),
        ("study", "scenario = 'fig4'\nsample = { n = 0, range = {} }"),
        ("study", "scenario = 'fig4'\nstop_time = { base = 3.0 }"),
        ("study", "scenario = 'fig4'\nfigures = { f = { kind = 'band' } }"),
    ],
)
def test_schema_takes_no_file_with_a_mistake(kind: str, text: str):
    assert not validator(kind).is_valid(tomllib.loads(text))
