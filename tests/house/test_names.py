"""Terms live where the glossary says, and tests are named after what they test."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
GLOSSARY = (ROOT / "docs" / "contributing" / "glossary.md").read_text(encoding="utf-8")
TERMS = re.findall(r"^\| (.+?) \| (.*?)\| `([\w./-]+)`(?: `(\w+)`)? \|$", GLOSSARY, re.MULTILINE)
USERS = (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")
RETIRED = re.findall(r"^\| `(\w+)` \| .+ \|$", GLOSSARY, re.MULTILINE)


def test_a_unit_test_is_named_after_what_it_tests():
    """A module, or a folder; `auv_fmu` is in `src`."""
    for path in (ROOT / "tests" / "unit").rglob("test_*.py"):
        tested = path.relative_to(ROOT / "tests" / "unit").with_stem(path.stem[5:])
        found = [ROOT / tested, ROOT / "src" / tested]
        ways = [way for it in found for way in (it, it.with_suffix(".c"), it.with_suffix(""))]
        assert any(way.exists() for way in ways), path


def test_terms_are_told_once_and_in_order():
    names = [term.casefold() for term, *_ in TERMS]
    assert len(names) >= 40
    assert names == sorted(set(names))
    told = re.findall(r"^\| (.+?) \| .+ \|$", USERS, re.MULTILINE)[1:]
    assert told == sorted(set(told), key=str.casefold)
    assert {term for term, meaning, *_ in TERMS if not meaning} <= {*told}


@pytest.mark.parametrize(("place", "name"), [term[2:] for term in TERMS], ids=str)
def test_terms_live_where_the_glossary_says(place, name):
    path = ROOT / place
    assert path.exists()
    if name:
        text = path.read_text(encoding="utf-8")
        assert re.search(rf"^ *(?:class|def) {name}\b|^{name}\b.* = ", text, re.MULTILINE)


def test_words_that_were_retired_name_nothing():
    """No module, class, function or variable, and no word of a page."""
    assert RETIRED
    word = re.compile(rf"\b_?({'|'.join(RETIRED)})s?\b", re.IGNORECASE)
    for folder in ("src", "fmus", "orchestrator", "docs", "tools"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".py", ".md", ".c", ".h") and path.name != "glossary.md":
                file = path.relative_to(ROOT)
                assert not word.search(f"{file}\n{path.read_text(encoding='utf-8')}"), file
