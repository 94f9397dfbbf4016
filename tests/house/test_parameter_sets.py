"""A field inserted into a named tuple must not give the others wrong names."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import auv_fmu

MODULES = {path.stem: ast.parse(path.read_text()) for path in Path(*auv_fmu.__path__).rglob("*.py")}


def nodes(tree: ast.AST, kind: type) -> Iterator:
    return (node for node in ast.walk(tree) if isinstance(node, kind))


#: Names of the fields of every named tuple, by its module and name.
FIELDS = {
    (module, node.name): [field.target.id for field in nodes(node, ast.AnnAssign)]
    for module, tree in MODULES.items()
    for node in nodes(tree, ast.ClassDef)
    if "NamedTuple" in map(ast.unparse, node.bases)
}


def named_tuples(module: str, function: ast.FunctionDef) -> dict[str, list[str]]:
    """Arguments of a function of a module that are named tuples, with their fields."""
    known = {name: fields for (where, name), fields in FIELDS.items() if where != module}
    known |= {name: fields for (where, name), fields in FIELDS.items() if where == module}
    return {
        argument.arg: known[ast.unparse(argument.annotation)]
        for argument in function.args.args
        if argument.annotation and ast.unparse(argument.annotation) in known
    }


def test_the_vehicle_is_among_them():
    functions = {f.name: f for f in nodes(MODULES["vehicle"], ast.FunctionDef)}
    assert "vehicle" in named_tuples("vehicle", functions["accelerations"])


@pytest.mark.parametrize("module", MODULES)
def test_named_tuples_are_unpacked_whole_and_by_the_names_of_their_fields(module):
    for function in nodes(MODULES[module], ast.FunctionDef):
        arguments = named_tuples(module, function)
        for assignment in nodes(function, ast.Assign):
            fields = arguments.get(ast.unparse(assignment.value))
            if fields and isinstance(assignment.targets[0], ast.Tuple):
                targets = [
                    field if isinstance(target, ast.Tuple) or target.id == "_" else target.id
                    for target, field in zip(assignment.targets[0].elts, fields, strict=True)
                ]
                assert targets == fields


@pytest.mark.parametrize("module", MODULES)
def test_named_tuples_are_never_indexed(module):
    for function in nodes(MODULES[module], ast.FunctionDef):
        named = {*named_tuples(module, function), "self.vehicle"}
        assert not named & {ast.unparse(node.value) for node in nodes(function, ast.Subscript)}
