"""All mistakes of a component are listed at once, by file and line."""

from __future__ import annotations

import py_compile
import subprocess
import sys
from importlib.util import cache_from_source
from pathlib import Path

import pytest

from fmus import check
from fmus.native import packaging
from orchestrator.machine.compilers import machines_compiler
from support.own import called, write


@pytest.fixture
def mistakes(tmp_path, monkeypatch):
    """The exit status of `fmus.check` in a folder, and its lines."""
    monkeypatch.chdir(tmp_path)
    for name in ("own_lag", "own_index", "own", "beside"):
        monkeypatch.delitem(sys.modules, name, raising=False)

    def checked(*arguments: object) -> tuple[int, list[str]]:
        status, out, errors = called(check.main, tmp_path, *arguments)
        return status, (out + errors).splitlines()

    return checked


def test_of_a_good_component_nothing_is_said(tmp_path, mistakes):
    assert mistakes(write(tmp_path)) == (0, [])


def test_everything_is_listed_in_the_order_of_the_lines(tmp_path, mistakes):
    write(
        tmp_path,
        ("return State(state.x -", "y = [1.0, 2.0]\n    return State(state.x ** 0.5 -"),
        ('Variable("m", "Value")', 'Variable("m", "Value", tunable=True)'),
        ("from math import expm1", "from beside import expm1, half"),
        ("return Outputs(state.x)", "return Outputs(half(state.x))"),
    )
    (tmp_path / "beside.py").write_text(
        "from math import expm1\n\n\ndef half(x: float) -> float:\n    return sum((x, x)) / 4.0\n"
    )
    status, lines = mistakes("own_lag.py")
    assert status == 0
    assert [line.partition(" is ")[0] for line in lines] == [
        "beside.py:5: the name sum",
        "own_lag.py:39: Outputs.x",
        "own_lag.py:55: a list",
        "own_lag.py:56: ** with other than a whole constant",
    ]


def test_what_only_the_translation_finds_is_told(tmp_path, mistakes):
    write(tmp_path, ("return Outputs(state.x)", "return Outputs(1)"))
    status, [line] = mistakes("own_lag.py")
    assert status == 0
    assert line.startswith("own_lag.py:60: ")


def test_numbers_too_many_for_the_stack_are_told(tmp_path, mistakes):
    many = "Vector(k * x for k in range(65_536))"
    write(
        tmp_path,
        ("import POSITIVE, Refusal, Variable", "import POSITIVE, Refusal, Variable, Vector"),
        ("return Outputs(state.x)", f"x = state.x\n    return Outputs(({many} + {many}).sum())"),
    )
    lines = mistakes("own_lag.py")[1]
    assert any(
        "C takes at most 49152, since they are on a thread's stack" in line for line in lines
    )


def test_an_expression_that_is_too_long_is_told(tmp_path, mistakes):
    write(tmp_path, ("return Outputs(state.x)", f"return Outputs({'state.x + ' * 3000}state.x)"))
    assert "own_lag.py: an expression is too long: take it apart" in mistakes("own_lag.py")[1]


def test_a_module_that_cannot_be_imported_is_told(tmp_path, mistakes):
    write(tmp_path, ("from math import expm1", "import nothing_there\nfrom math import expm1"))
    assert [line.split(";")[0] for line in mistakes("own_lag.py")[1]] == [
        "own_lag.py:8: ModuleNotFoundError: No module named 'nothing_there'"
    ]


INDEX = """\
from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Inputs(NamedTuple):
    x: Annotated[float, Variable("m", "A signal", name="plant.x")]


class Outputs(NamedTuple):
    last: Annotated[float, Variable("m", "Its last value")]


def start(inputs: Inputs) -> Inputs:
    return inputs


def update(acting: Inputs) -> Inputs:
    return acting


def outputs(state: Inputs, h: float) -> Outputs:
    return Outputs(state.x ** 0.5)
"""


@pytest.mark.parametrize("option", [(), ("--index",)])
def test_an_index_is_checked_as_such(tmp_path, option, mistakes):
    (tmp_path / "own_index.py").write_text(INDEX)
    status, lines = mistakes("own_index.py", *option)
    assert status == 0
    assert [line.partition(";")[0] for line in lines] == [
        "own_index.py:24: own_index.outputs takes h, which is not one of state, t, begin, end",
        "own_index.py:25: ** with other than a whole constant is not in the language of equations",
    ]


def test_other_modules_than_components_are_refused(tmp_path, mistakes):
    path = tmp_path / "own.py"
    path.write_text("x = 1\n")
    assert mistakes(path) == (
        2,
        [
            f"{path}: not a component: it has no function outputs() (see `auv-fmu new`);"
            " if it has a class of PythonFMU, build it and check its FMU: "
            f"auv-fmu build {path}"
        ],
    )


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_what_the_compiler_says_of_the_translation_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(packaging, "tables", lambda *_: "int = 1;\n")
    monkeypatch.chdir(tmp_path)
    write(tmp_path, name="own_c")
    [line] = check.mistakes(Path("own_c.py"), tmp_path)
    assert line.startswith("own_c.py: ") and "ports.h:1" in line


def test_what_a_hook_says_wrong_is_told_with_the_line_of_the_argument(tmp_path, mistakes):
    write(tmp_path, ("inputs: Inputs, h: float", "inputs: Inputs,\n    h: int"))
    why = "own_lag.py:54: own_lag.update takes h as int; write float"
    assert mistakes("own_lag.py") == (0, [why])


def test_printed_lines_are_not_counted_as_mistakes(tmp_path, mistakes):
    path = write(tmp_path, ('__author__ = "Me"', '__author__ = print("Hello") or "Me"'))
    assert mistakes(path) == (0, ["Hello"])


@pytest.mark.parametrize("module", ["check", "build"])
def test_byte_code_beside_a_component_is_neither_believed_nor_written(tmp_path, module):
    """Python would run this byte code instead of the text."""
    write(tmp_path, ("from math import expm1", "from beside import expm1"))
    (tmp_path / "beside.py").write_text("from math import expm1\n")
    (tmp_path / "other.py").write_text("raise SystemExit('other code')\n")
    for name in ("own_lag", "beside"):
        py_compile.compile(
            str(tmp_path / "other.py"),
            cache_from_source(str(tmp_path / f"{name}.py")),
            invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH,
        )
    (tmp_path / "other.py").unlink()
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.py*") if path.is_file()}
    out = tmp_path / "out"
    out.mkdir()
    command = [sys.executable, "-P", "-m", f"fmus.{module}", "own_lag.py", "--out", str(out)]
    process = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (process.returncode, process.stdout + process.stderr) == (0, "")
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.py*")} == before
