"""Tests that pages name are there."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
NAMED = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")


@cache
def functions(file: str) -> set[str]:
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def promises() -> list[str]:
    """The items of the page, each in one line."""
    text = (ROOT / "docs" / "reference" / "promises.md").read_text(encoding="utf-8")
    listed, _, _ = text.partition("\n## Where it was tried\n")
    return [" ".join(item.split()) for item in re.findall(r"^- (.+(?:\n  .+)*)", listed, re.M)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_named_tests_are_there(page):
    for file, test in NAMED.findall(page.read_text(encoding="utf-8")):
        assert (ROOT / file).is_file()
        assert not test or test in functions(file), f"{file}::{test}"


def test_there_are_promises():
    assert len(promises()) > 20


def test_every_promise_names_the_test_that_holds_it():
    for promise in promises():
        assert NAMED.findall(promise), promise
