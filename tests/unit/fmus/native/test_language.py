"""Each part of Python's syntax is translated, or refused with its line: none is left out of the C."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

import pytest

from fmus.language.build import Untranslatable
from support.language import HEAD, Twins, c_text, module_of

#: A function of which `?` is a part.
HOW = "def f(x: float, v: Annotated[Vector, 3]) -> float:\n    ?\n    return x\n"

#: What each kind of statement and expression is in.
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
        "AnnAssign", "Assert", "Assign", "Attribute", "AugAssign", "BinOp", "BoolOp", "Break", "Call",
        "Compare", "Constant", "Continue", "For", "FunctionDef", "GeneratorExp", "If", "IfExp",
        "Match", "Name", "Pass", "Raise", "Return", "Slice", "Starred", "Subscript", "Tuple", "UnaryOp",
        "While",
    )
)  # fmt: skip


def said_of(text: str, folder: Path) -> list[str]:
    """What is said of a function; nothing: C does the same."""
    try:
        module = module_of(HEAD + text, folder)
        c_text({"f": module.f})
    except Untranslatable as error:
        return [line.replace(str(folder / "own.py"), "own.py") for line in error.args]
    except SyntaxError as error:
        return [f"own.py:{error.lineno}: {error.msg}"]
    twins = Twins(module, folder)
    for x in (-1.0, 0.5, 3.0):
        given = (x, 0.5, 2.0, -1.0)
        assert twins.c("f", given) == twins.python("f", given)
    return []


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_statement_and_expression_is_translated_or_refused(tmp_path, kind):
    text = HOW.replace("?", PARTS[kind])
    tree = ast.parse(text)
    assert any(type(node).__name__ == kind for node in ast.walk(tree))
    said = said_of(text, tmp_path)
    assert bool(said) == (kind not in TRANSLATED)
    first = HEAD.count("\n") + 1
    for line in said:
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
    said = said_of(text, tmp_path)
    assert all(re.match(r"own\.py:\d+: ", line) and kind.__name__ not in line for line in said)
    known = (
        ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow, ast.USub, ast.UAdd, ast.Not,
        ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq,
    )  # fmt: skip
    assert bool(said) == (kind not in known)


def test_every_kind_of_this_python_has_an_example():
    assert set(KINDS) <= {*PARTS}
    if sys.version_info >= (3, 14):
        assert set(KINDS) == {*PARTS}
