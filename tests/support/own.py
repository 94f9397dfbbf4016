"""A component of one file, variants of its text, and FMUs of such files."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

import fmpy
import pytest

from fmus.kinds import PYTHON
from fmus.native.packaging import NativeKind
from fmus.python.packaging import PythonKind, best_loader
from fmus.script import source_of_script
from orchestrator.machine.compilers import compiler_for, platforms

LAG = '''\
"""A first-order lag, T dx/dt = u - x, solved exactly.

Its page.
"""

from __future__ import annotations

from math import expm1
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Refusal, Variable

__author__ = "Me"
__version__ = "1.2"


class Parameters(NamedTuple):
    """What may be set."""

    T: Annotated[float, Variable("s", "Time constant", minimum=POSITIVE, tunable=True)] = 0.5
    x0: Annotated[float, Variable("m", "Initial value")] = 1.0


class Inputs(NamedTuple):
    """What it follows."""

    u: Annotated[float, Variable("m", "Set point")] = 0.0


class State(NamedTuple):
    """What it remembers."""

    x: float


class Outputs(NamedTuple):
    """What is seen of it."""

    x: Annotated[float, Variable("m", "Value")]


def check(parameters: Parameters) -> None:
    """Refuse what is too far away."""
    if parameters.x0 > 100.0:
        raise Refusal("x0 is too far away")


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.x0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step."""
    return State(state.x - (inputs.u - state.x) * expm1(-h / parameters.T))


def outputs(state: State) -> Outputs:
    """What is seen of it."""
    return Outputs(state.x)
'''


def write(folder: Path, *changes: tuple[str, str], name: str = "own_lag") -> Path:
    """The script in a folder, with some words of it changed."""
    text = LAG
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / f"{name}.py"
    path.write_text(text, encoding="utf-8")
    return path


def imported(
    patch: pytest.MonkeyPatch, folder: Path, *changes: tuple[str, str], name: str = "own_lag"
) -> ModuleType:
    """Import the module of the script again."""
    write(folder, *changes, name=name)
    patch.syspath_prepend(folder)
    patch.delitem(sys.modules, name, raising=False)
    return import_module(name)


def called(main: Callable[[], int], folder: Path, *arguments: object) -> tuple[int, str, str]:
    """Call a module's command line, and forget the modules that it imported from a folder.

    Returns:
        Exit status, output and errors.

    """
    out, errors = StringIO(), StringIO()
    argv = ["main", *map(str, arguments)]
    with patch.object(sys, "argv", argv), redirect_stdout(out), redirect_stderr(errors):
        status = main()
    for name, module in [*sys.modules.items()]:
        if str(getattr(module, "__file__", None)).startswith(str(folder.resolve())):
            del sys.modules[name]
    return status, out.getvalue(), errors.getvalue()


def built(script: Path, kind: str, folder: Path, fmi: str = "2") -> Path:
    """Build the FMU of a script for this machine, and unpack it into a folder."""
    fmu, source = folder.with_suffix(".fmu"), source_of_script(script)
    _ = source.definition  # from now on the files that the script reads are known
    if kind == PYTHON:
        PythonKind(best_loader()).write(source, fmu)
    else:
        here = platforms(fmi, None)
        NativeKind(fmi, here, compiler_for(here), lambda line: None).write(source, fmu)
    return Path(fmpy.extract(str(fmu), folder))
