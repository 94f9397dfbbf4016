"""The equations keep to the language that every kind of FMU can run: language.md."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import auv_fmu
from fmus.discovery import components
from fmus.native.language import INSTEAD, MATHEMATICS, OUTSIDE, foreign

ROOT = Path(__file__).parents[2]
#: Where the package was installed: what stands outside the language is told by that place.
PACKAGE = Path(str(auv_fmu.__file__)).parent
#: What is declared with, and what the C kind has of its own.
NO_EQUATIONS = ("arrays.py", "quantities.py", "variable.py", "proof/*.py")
EQUATIONS = [
    *sorted(
        {*PACKAGE.rglob("*.py")} - {path for place in NO_EQUATIONS for path in PACKAGE.rglob(place)}
    ),
    *(ROOT / f"{module.replace('.', '/')}.py" for module in components().values()),
]


@pytest.mark.parametrize("path", EQUATIONS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_equations_keep_to_their_language(path):
    assert foreign(path) == []


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_stands_outside_is_that_of_the_equations_only(tmp_path, name):
    """A module of the user's with the same name is held to the language."""
    module, function = name.split(".")
    path = tmp_path / f"{module}.py"
    path.write_text(f"def {function}(x: float) -> float:\n    with x:\n        return x\n")
    assert [line.partition(" is ")[0] for line in foreign(path)] == [f"{path}:2: with"]


def test_blocks_that_do_not_run_when_a_module_is_imported_are_skipped(tmp_path):
    path = tmp_path / "equation.py"
    path.write_text(
        'if __name__ == "__main__":\n    import pylab\n    print(pylab)\n'
        "if TYPE_CHECKING:\n    from collections.abc import Callable\n"
        'if __name__ == "__main__":\n    pass\nelse:\n    x = 1.0\n'
    )
    assert [line.partition(" is ")[0] for line in foreign(path)] == [
        f"{path}:6: if at the level of the module"
    ]


def test_what_stands_outside_is_there():
    for name in OUTSIDE:
        module, function = name.split(".")
        [path] = PACKAGE.rglob(f"{module}.py")
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert function in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_page_names_the_functions_and_what_stands_outside():
    page = (ROOT / "docs/explanation/language.md").read_text(encoding="utf-8")
    assert set(re.findall(r"`math\.(\w+)`", page)) == MATHEMATICS | {"hypot"}
    assert all(f"`{name}`" in page for name in OUTSIDE)


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("    return hypot(x, 1.0)", "the name hypot"),
        ("    return sum((x, 1.0))", "the name sum"),
        ("    return math.gamma(x)", "the name math.gamma"),
        ("    return x**0.5", "** with other than a whole constant"),
        ("    return x | 2", "the operator |"),
        ("    return f(a * x for a in (1.0, 2.0))", "an expression with a for"),
        ("    return max(a * x for a in (1.0, 2.0))", "max of an expression with a for"),
        ("    return sum([a * x for a in (1.0, 2.0)])", "sum of an expression with a for"),
        ("    return any(a > x for a in (1.0, 2.0))", "any of an expression with a for"),
        ("    return [x][0]", "a list"),
        ("    return {1: x}[1]", "a dict"),
        ("    return (y := x)", ":="),
        ("    return f\"{x}\"", "an f-string"),
        ("    return x if x is x else 1.0", "a comparison other than of size"),
        ("    return cos(**x)", "a call with **"),
        ("    return (lambda y: y)(x)", "lambda"),
        ("    return 1j", "the constant 1j"),
        ("    while True:\n        x += 1.0", "a while that changes nothing in its condition"),
        ("    x = y = 1.0\n    return x", "more names than one for a value"),
        ("    for k in range(3):\n        x += k\n    else:\n        x = 1.0", "else of a for"),
        ("    try:\n        return x\n    finally:\n        pass", "try"),
        ("    with x:\n        return x", "with"),
        ("    x.y = 1.0\n    return x", "an assignment to a field"),
        ("    x[0] = 1.0\n    return x", "an assignment to an element"),
        ("    x[0, 1] = 1.0\n    return x", "an assignment to an element of a matrix"),
        ("    global y\n    return x", "global"),
        ("    raise ValueError", "a raise without a text"),
        ("    x: float\n    return x", "a variable without a value"),
    ],
)  # fmt: skip
def test_what_is_foreign_is_named_with_its_line(tmp_path, line, what):
    path = tmp_path / "equation.py"
    head = "import math\nfrom math import cos, hypot\n\ndef equation(x: float) -> float:\n"
    path.write_text(head + line + "\n")
    first, *_ = foreign(path)
    place, _, said = first.removeprefix(f"{path}:").partition(": ")
    better = f"; {INSTEAD[what]}" if what in INSTEAD else ""
    assert said == f"{what} is not in the language of equations{better}"
    assert int(place) in (5, 7, 8)


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("def f(x=1.0):\n    return x\n", 1, "more than plain arguments of f"),
        ("def f(x):\n    return x\n", 1, "an argument or a result of f without a type"),
        ("class A:\n    x: float\n", 1, "the class A"),
        ("x = 1.0\nfor y in (1, 2):\n    x = y\n", 2, "for at the level of the module"),
        (
            "from typing import NamedTuple\nclass A(NamedTuple):\n    x: float\n"
            "    def f(self) -> float:\n        return self.x\n",
            4,
            "def in the class A",
        ),
    ],
)
def test_what_is_foreign_in_a_module_is_named_with_its_line(tmp_path, text, line, what):
    path = tmp_path / "equation.py"
    path.write_text(text)
    first, *_ = foreign(path)
    assert first == f"{path}:{line}: {what} is not in the language of equations"
