"""Which names a piece of a program gives a value, and which it uses."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from copy import deepcopy
from typing import Any


def stored_names(*nodes: ast.AST) -> list[str]:
    """Names that are given a value, but not in functions and expressions of their own."""
    found: list[str] = []
    for node in nodes:
        if isinstance(node, ast.FunctionDef):
            found.append(node.name)
        elif isinstance(node, ast.Name):
            found += [node.id] if isinstance(node.ctx, ast.Store) else []
        elif not isinstance(node, ast.GeneratorExp):
            found += stored_names(*ast.iter_child_nodes(node))
    return found


def loaded_names(*nodes: ast.AST) -> list[str]:
    """Names that are used."""
    parts = [part for node in nodes for part in ast.walk(node)]
    names = [n.id for n in parts if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)]
    return names + [n.target.id for n in parts if isinstance(n, ast.AugAssign)
                    and isinstance(n.target, ast.Name)]  # fmt: skip


def free_names(*nodes: ast.AST) -> list[str]:
    """Names that are used in code and belong to what is around it, in the order of their use."""
    found: list[str] = []
    for node in nodes:
        if isinstance(node, ast.Name):
            found += [node.id] if isinstance(node.ctx, ast.Load) else []
        elif isinstance(node, ast.FunctionDef):
            own = {argument.arg for argument in node.args.args} | set(stored_names(*node.body))
            found += [name for name in free_names(*node.body) if name not in own]
        elif isinstance(node, ast.GeneratorExp):
            first, *others = node.generators
            own = {name for one in node.generators for name in names_in(one.target)}
            inner = free_names(node.elt, *(one.iter for one in others))
            found += [*free_names(first.iter), *(name for name in inner if name not in own)]
        elif isinstance(node, ast.AnnAssign):
            found += free_names(*filter(None, [node.value]))
        else:
            found += free_names(*ast.iter_child_nodes(node))
    return found


def always_stored(node: ast.stmt) -> set[str] | None:
    """Names that a statement gives a value on every way through it; None: none leads through."""
    if isinstance(node, (ast.Return, ast.Raise, ast.Break, ast.Continue)):
        return None
    if isinstance(node, ast.If):
        return both(_all_stored(node.body), _all_stored(node.orelse))
    if isinstance(node, (ast.While, ast.For)):
        return set()
    return set(stored_names(node))


def _all_stored(statements: Iterable[ast.stmt]) -> set[str] | None:
    found: set[str] = set()
    for statement in statements:
        stored = always_stored(statement)
        if stored is None:
            return None
        found |= stored
    return found


def both(one: set[str] | None, other: set[str] | None) -> set[str] | None:
    """What is in both; None stands for everything."""
    if one is None or other is None:
        return one if other is None else other
    return one & other


def names_in(node: ast.expr) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def renamed(node: ast.GeneratorExp, names: Mapping[str, str]) -> ast.GeneratorExp:
    """The same expression with other names of its own; what it runs over lies outside of it."""
    made = deepcopy(node)
    for part in ast.walk(made):
        if isinstance(part, ast.Name):
            part.id = names.get(part.id, part.id)
    made.generators[0].iter = node.generators[0].iter
    return made


def constant_of(node: ast.expr) -> Any:
    """A number or a text that is written out; None: it is computed."""
    try:
        return ast.literal_eval(node)
    except ValueError:
        return None


def is_dotted_name(node: ast.expr) -> bool:
    """Whether an expression is a name, or a part of one."""
    if isinstance(node, (ast.Attribute, ast.Subscript)):
        return is_dotted_name(node.value)
    return isinstance(node, (ast.Name, ast.Constant)) or (
        isinstance(node, ast.UnaryOp) and re.fullmatch(r"-[\d.]+", ast.unparse(node)) is not None
    )


def is_fixed_name(node: ast.expr) -> bool:
    """Whether an expression is a name, or a part of one at a place that is written out."""
    places = [part.slice for part in ast.walk(node) if isinstance(part, ast.Subscript)]
    return is_dotted_name(node) and all(constant_of(place) is not None for place in places)
