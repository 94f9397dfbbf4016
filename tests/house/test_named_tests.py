"""Tests that pages name are there, and every module has one or is named where the reason stands."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
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
    """The rows of the tables of promises."""
    text = (ROOT / "docs" / "reference" / "promises.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    return [row for row in rows if row != "| promise | held by |"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_named_tests_are_there(page):
    for file, test in NAMED.findall(page.read_text(encoding="utf-8")):
        assert (ROOT / file).is_file()
        assert not test or test in functions(file), f"{file}::{test}"


def test_there_are_promises():
    assert len(promises()) > 20


def test_every_promise_names_the_test_that_holds_it():
    for promise in promises():
        assert any(test for _, test in NAMED.findall(promise)), promise


def modules() -> set[str]:
    """All modules with code of their own."""
    tops = (ROOT / "src", ROOT / "fmus", ROOT / "orchestrator")
    files = (path.relative_to(ROOT) for top in tops for path in top.rglob("*.py"))
    return {str(file) for file in files if not file.name.startswith("__")}


def has_test(module: str) -> bool:
    path = ROOT / "tests" / "unit" / module.removeprefix("src/")
    return path.with_name(f"test_{path.name}").is_file()


def excused() -> Iterator[tuple[str, set[str]]]:
    """What the page on tests names as modules without one: patterns, and what they match."""
    page = (ROOT / "docs" / "contributing" / "testing.md").read_text(encoding="utf-8")
    _, _, section = page.partition("\n## Modules without a test of their own\n")
    rows = re.findall(r"^\| (`.+?) \|", section.partition("\n## ")[0], re.MULTILINE)
    for pattern in re.findall("`(.+?)`", " ".join(rows)):
        yield pattern, {str(path.relative_to(ROOT)) for path in ROOT.glob(pattern)} & modules()


def test_every_module_has_a_test_or_stands_in_the_list_of_those_without():
    without = {module for module in modules() if not has_test(module)}
    assert without - set().union(*(matched for _, matched in excused())) == set()
    for pattern, matched in excused():
        assert matched & without, f"{pattern} is no module without a test"
