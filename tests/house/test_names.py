"""Terms live where the glossary says, and tests are named after what they test."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = (ROOT / "docs" / "contributing" / "glossary.md").read_text(encoding="utf-8")
TERMS = re.findall(r"^\| (.+?) \| .+? \| `([\w./-]+)`(?: `(\w+)`)? \|$", GLOSSARY, re.MULTILINE)
USERS = (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")


def test_a_unit_test_is_named_after_what_it_tests():
    """A module, or a folder; `auv_fmu` is in `src`."""
    for path in (ROOT / "tests" / "unit").rglob("test_*.py"):
        tested = path.relative_to(ROOT / "tests" / "unit").with_stem(path.stem[5:])
        found = [ROOT / tested, ROOT / "src" / tested]
        ways = [
            way for path in found for way in (path, path.with_suffix(".c"), path.with_suffix(""))
        ]
        assert any(way.exists() for way in ways), path


def test_terms_are_told_once_and_in_order():
    names = [term for term, *_ in TERMS]
    users = re.findall(r"^\| (.+?) \| .+ \|$", USERS, re.MULTILINE)[1:]
    for listed in (names, users):
        assert len(listed) >= 25
        assert listed == sorted(set(listed), key=str.casefold)


@pytest.mark.parametrize(("place", "name"), [term[1:] for term in TERMS], ids=str)
def test_terms_live_where_the_glossary_says(place, name):
    path = ROOT / place
    assert path.exists()
    if name:
        text = path.read_text(encoding="utf-8")
        assert re.search(rf"^ *(?:class|def) {name}\b|^{name}\b.* = ", text, re.MULTILINE)
