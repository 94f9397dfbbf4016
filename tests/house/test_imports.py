"""Imports run one way: orchestrator -> (built FMUs), fmus -> auv_fmu."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import auv_fmu
import fmus
import orchestrator

#: Modules of auv_fmu that never run inside an FMU.
WITH_NUMPY = {"control_point_model.py"}


def imports(package) -> Iterator[tuple[Path, str]]:
    [folder] = package.__path__
    for path in Path(folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                yield from ((path, alias.name.split(".")[0]) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{path}: relative import"
                yield path, str(node.module).split(".")[0]


@pytest.mark.parametrize(
    ("package", "allowed"),
    [
        (auv_fmu, {"auv_fmu"}),
        (fmus, {"auv_fmu", "fmus", "markdown_it", "pythonfmu"}),
        (
            orchestrator,
            {
                "auv_fmu",
                "orchestrator",
                "fmpy",
                "libcosimpy",
                "markdown_it",
                "matplotlib",
                "numpy",
                "PIL",
                "tqdm",
            },
        ),
    ],
)
def test_imports_run_one_way(package, allowed):
    for path, module in imports(package):
        if path.name in WITH_NUMPY and module == "numpy":
            continue
        assert module in allowed | sys.stdlib_module_names, f"{path} imports {module}"
