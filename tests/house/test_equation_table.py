"""docs/reference/equations.md: complete, and true to the code."""

from __future__ import annotations

import ast
import re
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import auv_fmu
from support.settings import ports_of

TESTS = Path(__file__).parents[1]
PAGE = (TESTS.parent / "docs" / "reference" / "equations.md").read_text(encoding="utf-8")


def table(heading: str) -> list[list[str]]:
    section = PAGE.split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def quoted(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


@cache
def names_in(module: str) -> set[str]:
    trees = [ast.parse(path.read_text()) for path in TESTS.rglob(f"{module}.py")]
    return {node.name for tree in trees for node in tree.body if isinstance(node, ast.FunctionDef)}


def numbers(row: list[str]) -> list[int]:
    return [int(number) for number in re.findall(r"\((\d+)\)", row[0])]


def test_every_equation_from_1_to_59_is_listed_once():
    listed = [number for row in table("Equations") for number in numbers(row)]
    assert sorted(listed) == [*range(1, 60)]


@pytest.mark.parametrize("row", table("Equations"), ids=lambda row: row[0])
def test_equations_are_where_the_table_says(row):
    _, _, places, tests = row
    if places == "proof only":
        assert not tests
        return
    mentioned = set()
    for place in quoted(places):
        module, name = place.rsplit(".", 1)
        stated = getattr(import_module(module), name)
        text = f"{import_module(module).__doc__} {stated.__doc__}"
        found = {number for number in numbers(row) if mentions(text, number)}
        assert found, f"{place} does not mention {row[0]}"
        mentioned |= found
    assert mentioned == {*numbers(row)}
    for test in quoted(tests):
        module, name = test.split(".")
        assert name in names_in(module), test


def mentions(text: str, number: int) -> bool:
    """True if a text names an equation, also within a range such as "(4) to (8)"."""
    if f"({number})" in text:
        return True
    ranges = re.findall(r"\((\d+)\) to \((\d+)\)", text)
    return any(int(first) <= number <= int(last) for first, last in ranges)


@cache
def variables() -> set[str]:
    """Every parameter, field and variable of the equations."""
    found = set()
    model = TESTS / "support" / "control_point_model.py"
    for path in (*Path(*auv_fmu.__path__).rglob("*.py"), model):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.arg):
                found.add(node.arg)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                found.add(node.id)
    return found


@pytest.mark.parametrize("row", table("Symbols"), ids=lambda row: row[0])
def test_symbol_is_the_name_port_and_unit_that_the_table_says(row):
    _, code, port, unit = row
    assert quoted(code)
    assert set(quoted(code)) <= variables()
    for name in quoted(port):
        component, variable = name.split(".", 1)
        [declared] = [port for port in ports_of(component) if port.name == variable]
        assert (declared.unit or "") == unit
