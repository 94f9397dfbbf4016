"""Imports that wait until something is used: names of a package, progress bars, Parquet."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from orchestrator.machine.errors import InputError

#: Rows of a Parquet file that are read, or written, at once.
ROWS_AT_ONCE = 8192


def offered(
    package: str, modules: Mapping[str, str]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return the `__getattr__` and `__dir__` of a package that imports names on first use.

    Args:
        package: its name.
        modules: names separated by spaces, by the modules that define them.

    """
    places = {name: module for module, names in modules.items() for name in names.split()}

    def getattr_(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{places[name]}"), name)

    def dir_() -> list[str]:
        return sorted({*vars(sys.modules[package]), *places})

    return getattr_, dir_


def progress_bar(**options: Any) -> Any:
    """Return a bar of tqdm: a widget in a notebook that has widgets, else a line on a terminal."""
    is_widget = "ipykernel" in sys.modules and find_spec("ipywidgets") is not None
    return import_module("tqdm.notebook" if is_widget else "tqdm").tqdm(**options)


def passing_line(text: str) -> Any:
    """Return a context that shows a line on a terminal until it ends."""
    return progress_bar(bar_format=text, disable=None, leave=False)


def parquet() -> Any:
    """Return the module that reads and writes Parquet.

    Raises:
        InputError: it is not installed.

    """
    return _extra("pyarrow.parquet", "Parquet needs", "parquet")


def casadi() -> Any:
    """Return CasADi.

    Raises:
        InputError: it is not installed.

    """
    return _extra("casadi", "functions of CasADi need", "casadi")


def _extra(module: str, needs: str, extra: str) -> Any:
    """Return a module of a package that an extra brings."""
    package = module.partition(".")[0]
    if find_spec(package) is None:
        raise InputError(f"{needs} {package}: pip install 'auv-fmu[{extra}]'")
    return import_module(module)
