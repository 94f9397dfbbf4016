"""Each part of Python's syntax is translated, or refused with its line; none is left out."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import pytest

from fmus.language.build import Untranslatable
from fmus.language.words import INSTEAD
from support.language import HEAD, c_text, module_of

#: A function with a place for a part.
HOW = "def f(x: float, v: Annotated[Vector, 3]) -> float:\n    ?\n    return x\n"

#: An example of each kind of statement and expression.
PARTS = {
    # statements
    "AnnAssign": "x: float = 2.0 * x",
    "Assert": "assert x > 0.0",
    "Assign": "x = 2.0 * x",
    "AsyncFor": "async def g() -> None:\n        async for a in v: pass",
    "AsyncFunctionDef": "async def g() -> None: pass",
    "AsyncWith": "async def g() -> None:\n        async with v: pass",
    "AugAssign": "x += 2.0",
    "Break": "for a in v:\n        x += a\n        if x > 1.0: break",
    "ClassDef": "class A: pass",
    "Continue": "for a in v:\n        if a > 1.0: continue\n        x += a",
    "Delete": "del v",
    "Expr": "x",
    "For": "for a in v: x += a",
    "FunctionDef": "def g(a: float) -> float: return 2.0 * a\n    x = g(x)",
    "Global": "global K",
    "If": "if x > 0.0: x = 2.0",
    "Import": "import math",
    "ImportFrom": "from math import sin",
    "Match": "match int(x):\n        case 1 | 3: x = 2.0\n        case _: x = 4.0",
    "Nonlocal": "def g() -> None: nonlocal x",
    "Pass": "pass",
    "Raise": "raise Refusal('no')",
    "Return": "return 2.0 * x",
    "Try": "try: x = 2.0\n    finally: x = 3.0",
    "TryStar": "try: x = 2.0\n    except* ValueError: x = 3.0",
    "TypeAlias": "type A = float",
    "While": "while x > 1.0: x *= 0.5",
    "With": "with v: x = 2.0",
    # expressions
    "Attribute": "x = math.pi",
    "Await": "async def g() -> None: await x",
    "BinOp": "x = 2.0 + x",
    "BoolOp": "x = 2.0 if x > 1.0 and x < 2.0 else 3.0",
    "Call": "x = abs(x)",
    "Compare": "x = 2.0 if x > 1.0 else 3.0",
    "Constant": "x = 2.0",
    "Dict": "x = {'a': x}['a']",
    "DictComp": "x = {a: a for a in v}[1.0]",
    "FormattedValue": "y = f'{x}'",
    "GeneratorExp": "x = Vector(2.0 * a for a in v).sum()",
    "IfExp": "x = 2.0 if x > 1.0 else 3.0",
    "Interpolation": "y = t'{x}'",
    "JoinedStr": "y = f'{x}'",
    "Lambda": "x = (lambda: 2.0)()",
    "List": "x = [x][0]",
    "ListComp": "x = [a for a in v][0]",
    "Name": "x = x",
    "NamedExpr": "x = (y := x)",
    "Set": "x = max({x, 2.0})",
    "SetComp": "x = max({a for a in v})",
    "Slice": "x = v[1:].sum()",
    "Starred": "x = Vector((*v, 2.0)).sum()",
    "Subscript": "x = v[1]",
    "TemplateStr": "y = t'{x}'",
    "Tuple": "x, y = 2.0, x",
    "UnaryOp": "x = -x",
    "Yield": "yield x",
    "YieldFrom": "yield from v",
}  # fmt: skip

KINDS = sorted({kind.__name__ for kind in (*ast.stmt.__subclasses__(), *ast.expr.__subclasses__())})
OPERATORS = sorted(
    {kind for base in (ast.operator, ast.unaryop, ast.cmpop) for kind in base.__subclasses__()},
    key=lambda kind: kind.__name__,
)

#: Parts of Python that the language has.
TRANSLATED = frozenset(
    (
        "AnnAssign", "Assert", "Assign", "Attribute", "AugAssign", "BinOp", "BoolOp", "Break",
        "Call", "Compare", "Constant", "Continue", "For", "FunctionDef", "GeneratorExp", "If",
        "IfExp", "Match", "Name", "Pass", "Raise", "Return", "Slice", "Starred", "Subscript",
        "Tuple", "UnaryOp", "While",
    )
)  # fmt: skip


def said_of_module(text: str, folder: Path) -> list[str]:
    """Mistakes that are found in the function f of a module."""
    try:
        module = module_of(text, folder)
        c_text({"f": module.f})
    except Untranslatable as error:
        return [line.replace(str(folder / "own.py"), "own.py") for line in error.args]
    except SyntaxError as error:
        return [f"own.py:{error.lineno}: {error.msg}"]
    return []


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_statement_and_expression_is_translated_or_refused(tmp_path, kind):
    text = HOW.replace("?", PARTS[kind])
    tree = ast.parse(text)
    assert any(type(node).__name__ == kind for node in ast.walk(tree))
    lines = said_of_module(HEAD + text, tmp_path)
    assert bool(lines) == (kind not in TRANSLATED)
    first = HEAD.count("\n") + 1
    for line in lines:
        found = re.match(r"own\.py:(\d+): ", line)
        assert found, line
        assert first <= int(found[1]) <= first + text.count("\n")
        assert kind not in line.split(), "a word of Python's syntax tree"


@pytest.mark.parametrize("kind", OPERATORS, ids=lambda kind: kind.__name__)
def test_each_operator_is_translated_or_refused(tmp_path, kind):
    node = ast.parse("x + 2.0", mode="eval").body
    if issubclass(kind, ast.cmpop):
        node = ast.parse("2.0 if x < 2.0 else 3.0", mode="eval").body
        node.test.ops = [kind()]
    elif issubclass(kind, ast.unaryop):
        node = ast.UnaryOp(kind(), ast.Name("x"))
        if kind is ast.Not:
            node = ast.IfExp(node, ast.Constant(2.0), ast.Constant(3.0))
    else:
        node.op = kind()
    text = HOW.replace("?", f"x = {ast.unparse(node)}")
    lines = said_of_module(HEAD + text, tmp_path)
    assert all(re.match(r"own\.py:\d+: ", line) and kind.__name__ not in line for line in lines)
    known = (
        ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow, ast.USub, ast.UAdd,
        ast.Not, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq,
    )  # fmt: skip
    assert bool(lines) == (kind not in known)


def test_every_kind_of_this_python_has_an_example():
    assert set(KINDS) <= {*PARTS}
    if sys.version_info >= (3, 14):
        assert set(KINDS) == {*PARTS}


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("    return hypot(x, 1.0)", "the name hypot"),
        ("    return sum((x, 1.0))", "the name sum"),
        ("    return x**0.5", "** with other than a whole constant"),
        ("    return x | 2", "the operator |"),
        ("    return any([x > a for a in (1.0, 2.0)]) + x", "any of a list"),
        ("    return [x][0]", "a list"),
        ("    return {1: x}[1]", "a dict"),
        ("    return (y := x)", ":="),
        ("    return f\"{x}\"", "an f-string"),
        ("    return x if x is x else 1.0", "a comparison other than of size"),
        ("    return (lambda y: y)(x)", "lambda"),
        ("    return 1j", "the constant 1j"),
        ("    for k in range(3):\n        x += k\n    else:\n        x = 1.0", "else of a for"),
        ("    try:\n        return x\n    finally:\n        pass", "try"),
        ("    with x:\n        return x", "with"),
        ("    x.y = 1.0\n    return x", "an assignment to a field"),
        ("    x[0] = 1.0\n    return x", "an assignment to an element"),
        ("    x[0, 1] = 1.0\n    return x", "an assignment to an element of a matrix"),
        ("    global y\n    return x", "global"),
        ("    raise ValueError", "a raise without a text"),
        ("    while x > 1.0:\n        pass", "a while that changes nothing in its condition"),
    ],
)  # fmt: skip
def test_other_python_is_refused_with_its_line_and_an_alternative(tmp_path, line, what):
    head = "from math import hypot\n\n\ndef f(x: float) -> float:\n"
    [message] = said_of_module(head + line + "\n", tmp_path)
    place, _, message = message.removeprefix("own.py:").partition(": ")
    better = f"; {INSTEAD[what]}" if what in INSTEAD else ""
    assert message == f"{what} is not in the language of equations{better}"
    assert int(place) in (5, 7, 8)


def test_all_mistakes_of_all_functions_are_told_at_once_and_what_follows_from_them_is_not(tmp_path):
    text = (
        "def _twice(x, y: float) -> float:\n"
        "    z = [x]\n"
        "    return 2.0 * z[0] + y\n\n\n"
        "def f(x: float) -> float:\n"
        "    if x in (1.0, 2.0):\n"
        "        a = {}\n"
        "    total = 0\n"
        "    for k in set((1, 2)):\n"
        "        total += 0.5\n"
        "    b = a + missing\n"
        "    return _twice(x, 1) + b\n"
    )
    lines = [line.split(";")[0] for line in said_of_module(text, tmp_path)]
    outside = "is not in the language of equations"
    assert lines == [
        "own.py:1: the argument x of _twice has no type",
        f"own.py:2: a list {outside}",
        f"own.py:7: a comparison other than of size {outside}",
        f"own.py:8: a dict {outside}",
        "own.py:10: set is not a function of equations",
        "own.py:11: total is an int and gets a float: begin with a float, such as 0.0",
        "own.py:12: a may have no value here",
    ]


def test_what_no_hook_calls_may_be_any_python(tmp_path):
    text = "def plot(x):\n    with open(x) as file:\n        return [*file]\n\n\n"
    assert said_of_module(text + "def f(x: float) -> float:\n    return x\n", tmp_path) == []


def test_what_a_class_changes_of_a_tuple_is_refused(tmp_path):
    text = (
        "from typing import NamedTuple\n\n\nclass A(NamedTuple):\n    x: float\n\n"
        "    def __getitem__(self, k):\n        return 2.0\n\n\n"
        "def f(x: float) -> float:\n    return A(x)[0]\n"
    )
    [message] = said_of_module(text, tmp_path)
    assert message == "own.py:4: __getitem__ in the class A: leave it out"


def test_an_expression_too_deep_for_python_is_refused_with_a_line(tmp_path):
    text = "def f(x: float) -> float:\n    return " + "x + " * 995 + "x\n"
    [message] = said_of_module(text, tmp_path)
    assert re.match(r"own\.py:[12]: (too deep for Python|an expression of 200 levels)", message)


def test_calls_too_deep_for_python_are_refused_with_a_line(tmp_path):
    links = [f"def f{i}(x: float) -> float:\n    return f{i + 1}(x) + 1.0\n" for i in range(300)]
    text = "\n\n".join([*reversed(links), "def f300(x: float) -> float:\n    return x\n"])
    lines = said_of_module(text.replace("f0(", "f("), tmp_path)
    why = r"own\.py:[1-9]\d*: too deep for Python: .* join functions that call each other"
    assert lines and all(re.fullmatch(why, line) for line in lines)
