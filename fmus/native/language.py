"""The language of equations: the part of Python that every kind of FMU can run.

`docs/explanation/language.md` describes it for readers; this module finds code outside it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path

#: Functions of `math` that equations may use.
MATHEMATICS = frozenset(
    (
        "asin", "atan", "atan2", "copysign", "cos", "degrees", "exp", "expm1", "log", "log1p",
        "sin", "sqrt", "tanh",
    )
)  # fmt: skip

#: What else may be called without being imported.
BUILT_IN = frozenset(("abs",))

#: Functions that stand among the equations and are none, with the reason.
OUTSIDE = {
    "plant.white_noise": "makes the generator of the standard library that has the state",
    "euler.internal_steps": "makes an integer; the runtime in C has a twin, which looks first",
    "closed_loop.closed_loop": "is the generator of instants that all else is checked against",
}

#: Packages whose functions, tuples and constants equations share.
_PACKAGES = frozenset(("auv_fmu", "fmus"))

_BASES = frozenset(("NamedTuple", "TypedDict", "ArithmeticError"))
_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub, ast.Not)
_COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
_CONSTANTS = (float, int, bool)
_MODULE_LEVEL = (ast.Import, ast.ImportFrom, ast.Assign, ast.AnnAssign)


def foreign(path: Path) -> list[str]:
    """What is outside the language in a module: one line each that an editor can jump to."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [
        f"{path}:{line}: {what} is not in the language of equations"
        for line, what in sorted(_module(tree, path.stem), key=itemgetter(0))
    ]


_Found = Iterator["tuple[int, str]"]


def _module(tree: ast.Module, name: str) -> _Found:
    known = set(_known(tree))
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            if f"{name}.{node.name}" not in OUTSIDE:
                yield from _function(node)
                yield from _names(node, known)
        elif isinstance(node, ast.ClassDef):
            bases = [base.id for base in node.bases if isinstance(base, ast.Name)]
            if len(bases) != 1 or bases[0] not in _BASES or node.decorator_list:
                yield node.lineno, f"the class {node.name}"
            for part in node.body:
                if not isinstance(part, ast.AnnAssign) and not _is_text(part):
                    yield part.lineno, f"{_kind(part)} in the class {node.name}"
        elif not isinstance(node, _MODULE_LEVEL) and not _is_text(node):
            yield node.lineno, f"{_kind(node)} at the level of the module"


def _known(tree: ast.Module) -> Iterator[str]:
    """Names that a module's functions may use."""
    yield from BUILT_IN
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (target.id for target in targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.ImportFrom):
            names = {alias.asname or alias.name for alias in node.names}
            if node.module == "math":
                yield from names & MATHEMATICS
            elif str(node.module).split(".")[0] in _PACKAGES:
                yield from names


def _names(function: ast.FunctionDef, known: set[str]) -> _Found:
    names = [n for s in function.body for n in ast.walk(s) if isinstance(n, ast.Name)]
    local = {name.id for name in names if isinstance(name.ctx, ast.Store)}
    local |= {argument.arg for argument in function.args.args}
    for name in names:
        if name.id not in known | local:
            yield name.lineno, f"the name {name.id}"


def _function(node: ast.FunctionDef) -> _Found:
    given = node.args
    special = given.posonlyargs or given.kwonlyargs or given.vararg or given.kwarg
    if special or given.defaults or node.decorator_list:
        yield node.lineno, f"more than plain arguments of {node.name}"
    if node.returns is None or any(a.annotation is None for a in given.args):
        yield node.lineno, f"an argument or a result of {node.name} without a type"
    yield from _block(node.body)


def _block(statements: list[ast.stmt]) -> _Found:
    for node in statements:
        if isinstance(node, ast.Return) and node.value is not None:
            yield from _expression(node.value)
        elif isinstance(node, ast.Assign) and len(node.targets) == 1:
            yield from _target(node.targets[0])
            yield from _expression(node.value)
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            yield from _expression(ast.BinOp(node.target, node.op, node.value, lineno=node.lineno))
        elif isinstance(node, (ast.If, ast.While)) and not (
            isinstance(node, ast.While) and node.orelse
        ):
            yield from _expression(node.test)
            yield from _block([*node.body, *node.orelse])
        elif isinstance(node, ast.Raise):
            yield from _raised(node)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield from _expression(node.value)
        elif not _is_text(node):
            yield node.lineno, _kind(node)


def _target(node: ast.expr) -> _Found:
    if isinstance(node, ast.Tuple):
        for element in node.elts:
            yield from _target(element)
    elif not isinstance(node, ast.Name):
        yield node.lineno, f"an assignment to {_kind(node)}"


def _raised(node: ast.Raise) -> _Found:
    call = node.exc
    if not isinstance(call, ast.Call) or len(call.args) != 1 or node.cause is not None:
        yield node.lineno, "a raise without a text"
        return
    text = call.args[0]
    if isinstance(text, ast.JoinedStr):
        for part in text.values:
            if isinstance(part, ast.FormattedValue):
                yield from _expression(part.value)
    elif not (isinstance(text, ast.Constant) and isinstance(text.value, str)):
        yield node.lineno, "a raise without a text"


#: What expressions consist of.
_EXPRESSIONS = (
    ast.Constant, ast.Name, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Tuple,
    ast.Dict, ast.Attribute, ast.Starred, ast.Subscript, ast.Call,
)  # fmt: skip


def _expression(node: ast.expr) -> _Found:
    wrong = _wrong(node) if isinstance(node, _EXPRESSIONS) else _kind(node)
    if wrong:
        yield node.lineno, wrong
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.expr) and isinstance(node, _EXPRESSIONS):
            yield from _expression(part)


def _wrong(node: ast.expr) -> str | None:
    """What is wrong with an expression, apart from its parts."""
    wrong = None
    if isinstance(node, ast.Constant) and type(node.value) not in (*_CONSTANTS, str):
        wrong = f"the constant {node.value!r}"
    elif isinstance(node, (ast.BinOp, ast.UnaryOp)) and not isinstance(node.op, _OPERATORS):
        wrong = f"the operator {_kind(node.op)}"
    elif isinstance(node, ast.Compare) and not all(isinstance(o, _COMPARISONS) for o in node.ops):
        wrong = "a comparison other than of size"
    elif isinstance(node, ast.Subscript) and isinstance(node.slice, (ast.Slice, ast.Tuple)):
        wrong = "a subscript for more than one element"
    elif isinstance(node, ast.Dict) and not all(isinstance(k, ast.Constant) for k in node.keys):
        wrong = "a dict whose keys are not constants"
    elif isinstance(node, ast.Call) and node.keywords:
        wrong = "a call with names of arguments"
    return wrong


def _is_text(node: ast.stmt) -> bool:
    value = node.value if isinstance(node, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)


def _kind(node: ast.AST) -> str:
    return type(node).__name__
