"""Names of equations in C: all names that compilers know are good for variables and functions."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.discovery import source_of
from fmus.language.tree import Constant, Do, Function
from fmus.language.types import FLOAT, INT, Array, Record, type_of
from fmus.native.emit import Emitter
from fmus.native.names import in_c
from orchestrator.machine.compilers import SAME_NUMBERS, machines_compiler
from support.all_types.build import sources

ZIG = (sys.executable, "-m", "ziglang", "cc", "-target")
COMMANDS = {
    "this machine's": (str(machines_compiler()),),
    "Windows": (*ZIG, "x86_64-windows-gnu"),
    "macOS": (*ZIG, "aarch64-macos"),
}

#: Uses a variable beside everything that equations call.
_USE = """
static double use_{i}(double {name}, Error *error) {{
    const struct {{ double {name}; }} it_{i} = {{.{name} = {name}}};
    const double y_{i} = int_abs((int){name}, error) + py_pow({name}, 2.0, error);
    if (isfinite({name}) != 0 && isnan({name}) == 0 && isinf({name}) == 0) return INFINITY;
    for (int i_{i} = 0; i_{i} < 2; i_{i}++) raise_error(error, "%g", {name});
    const int k_{i} = int_of(trunc({name}), error) + place_in(2, 3, error);
    const Dual d_{i} = dual_div(dual_add((Dual){{{name}, 1.0}}, dual_fixed(2.0)),
        dual_larger(dual_neg(dual_fixed({name})), dual_fixed(1.0)), error);
    return y_{i} + it_{i}.{name} + fabs({name}) + k_{i} + math_sqrt({name}, error) + NAN + d_{i}.d;
}}
"""


def run(command: Sequence[str], folder: Path, *arguments: str) -> str:
    process = subprocess.run(
        [*command, "-std=gnu17", *SAME_NUMBERS, *arguments],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr[:3000]
    return process.stdout


def marked(name: str):
    is_there = find_spec("ziglang") if "ziglang" in COMMANDS[name] else machines_compiler()
    missing = pytest.mark.skipif(not is_there, reason="there is no C compiler for it")
    marks = [missing] if name.startswith("this") else [missing, pytest.mark.slow]
    return pytest.param(name, marks=marks)


@pytest.mark.parametrize("system", [marked(name) for name in COMMANDS])
def test_every_name_that_a_compiler_knows_can_be_a_variable_and_a_function(tmp_path, system):
    """Macros, functions, types, and every other name in the headers of the runtime."""
    command = COMMANDS[system]
    files = sources(source_of("PdController").definition)
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "identity.h").write_text('#define MODEL_NAME "it"\n#define MODEL_GUID "it"\n')
    text = run(command, tmp_path, "-E", "fmi2.c") + run(command, tmp_path, "-E", "-dM", "fmi2.c")
    words = sorted({*re.findall(r"\b[A-Za-z_]\w*", text)})
    assert {"size_t", "strlen", "math_errhandling", "EOF"} <= {*words}
    emitter = Emitter([])
    own = re.findall(r"\w+", files["equations.c"] + files["derivatives.c"])
    composed = [word for word in words if re.match("[A-Za-z]+_.", word)]
    functions = [emitter.unused(word) for word in composed if word not in own]
    code = [f"static double {name}(double x) {{ return x; }}" for name in functions]
    names = [in_c(word) for word in words if not iskeyword(word)]
    code += [_USE.format(i=i, name=name) for i, name in enumerate(names)]
    (tmp_path / "names.c").write_text("\n".join(['#include "fmi2.c"', *code]))
    # Zig makes a C library first unless it compiles.
    only = ["-O0", "-c"] if "ziglang" in command else ["-fsyntax-only"]
    run(command, tmp_path, *only, "names.c")


parts = st.sampled_from(
    ["x", "_", "__", "u", "_u", "00302", "0302", "\u0302", "int", "v_", "class_", "State",
     "Vector3", "EOF", "double", "error", "1", "é"]
)  # fmt: skip


@given(first=st.lists(parts, max_size=6), second=st.lists(parts, max_size=6))
def test_no_two_names_are_one_in_c(first, second):
    names = {name for name in ("".join(first), "".join(second)) if name.isidentifier()}
    assert len({in_c(name) for name in names}) == len(names)


#: Parts of names that look like what C has, and like each other.
stems = st.lists(st.sampled_from(["Foo", "x3", "_", "bar", "int", "double", "Vector3", "2"]))
identifiers = stems.map("".join).filter(str.isidentifier)
places = st.tuples(identifiers, identifiers)


@given(
    classes=st.lists(identifiers.filter(lambda name: name[0] != "_"), unique=True),
    functions=st.lists(places, unique=True),
    constants=st.lists(st.tuples(places, st.sampled_from([0.5, 2.0, 3]))),
)
def test_names_outside_of_functions_are_unique(classes, functions, constants):
    """Classes, arrays and tuples of them, functions and constants, in modules of any name."""
    records = [type_of(NamedTuple(name, [("x", float)])) for name in classes]
    types = [
        t
        for record in records
        for t in (record, Array(record, 3), Record((("m0", record), ("m1", INT))))
    ]
    found = [(*place, value, FLOAT if type(value) is float else INT) for place, value in constants]
    body = [Do(Constant(*pair)) for pair in found]
    arguments = {f"x{i}": type_ for i, type_ in enumerate((*types, Array(FLOAT, 3)))}
    made = [Function(*place, arguments, body=body) for place in functions]
    text = Emitter(made).text()
    names = re.findall(r"^(?:} |static (?:const )?\w+ )(\w+)", text, re.MULTILINE)
    count = len(types) + 1 + len(found) if made else 0
    assert len(names) == len({*names}) == len(made) + count
    assert not [name for name in names if name[0] in "_0123456789"]
    assert not {*names} & {in_c(name) for name in arguments}
