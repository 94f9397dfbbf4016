"""Functions of the language of equations in both languages, side by side, bit for bit."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Sequence
from ctypes import CDLL, POINTER, c_char, c_double, c_int, create_string_buffer
from dataclasses import dataclass
from enum import IntEnum
from math import isnan
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from auv_fmu.language.arrays import Matrix, Vector
from fmus.language.build import Program
from fmus.language.mathematics import CONSTANTS, FUNCTIONS
from fmus.language.tree import Function
from fmus.language.types import FLOAT, Array, Record, Scalar, Type, parts_of, type_of
from fmus.native.emit import Emitter, members
from fmus.native.names import RUNTIME, in_c
from fmus.ports.groups import hints_of
from fmus.ports.port import Refusal
from orchestrator.machine.compilers import SAME_NUMBERS

#: As FMUs are compiled.
FLAGS = ("-std=c99", *SAME_NUMBERS, "-fPIC", "-shared")

#: First lines of a test module.
HEAD = f"""\
from __future__ import annotations

import math
from enum import IntEnum
from math import isnan
from math import {", ".join(sorted(FUNCTIONS.keys() | CONSTANTS))}
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.linear_algebra import interpolate, solve
from fmus.ports.port import Refusal

"""

#: Bytes of a message, as in text.c.
_WHY = 2001

#: Error about an integer that C cannot hold.
TOO_LARGE = "OverflowError: an integer exceeds 32 bits"

_INCLUDES = """\
#include "arithmetic.h"
#include <string.h>
"""


@dataclass(frozen=True)
class Answer:
    """Result of a function: numbers, or an error with its text."""

    numbers: tuple[float, ...] = ()
    error: str = ""

    @property
    def bits(self) -> tuple[str, ...]:
        """The numbers by their bits, except that every NaN is the same."""
        return tuple("nan" if isnan(x) else float(x).hex() for x in self.numbers)


def module_of(text: str, folder: Path, name: str = "own") -> ModuleType:
    """A module from its text."""
    path = folder / f"{name}.py"
    path.write_text(text, encoding="utf-8")
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module
    specification.loader.exec_module(module)
    return module


class Twins:
    """The functions of a module in Python and in C."""

    def __init__(
        self, module: ModuleType, folder: Path, command: Sequence[str] = ("cc", "-O2")
    ) -> None:
        """Translate and compile all public functions of a module."""
        self.functions: dict[str, FunctionType] = {
            name: function
            for name, function in vars(module).items()
            if isinstance(function, FunctionType)
            and function.__module__ == module.__name__
            and not name.startswith("_")
        }
        self.text = c_text(self.functions)
        source = folder / "functions.c"
        source.write_text(self.text)
        library = folder / f"functions_{abs(hash(tuple(command)))}.so"
        process = subprocess.run(
            [*command, *FLAGS, "-I", str(RUNTIME), "-o", library, source, "-lm"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert process.returncode == 0, process.stderr
        self._library = CDLL(str(library))

    def python(self, name: str, numbers: Sequence[float]) -> Answer:
        """The answer in Python."""
        function = self.functions[name]
        hints = hints_of(function)
        hints.pop("return")
        values = iter(numbers)
        arguments = [_made(hint, values) for hint in hints.values()]
        try:
            result = function(*arguments)
        except Refusal as error:
            return Answer(error=str(error))
        except Exception as error:
            return Answer(error=f"{type(error).__name__}: {error}")
        numbers = _flat(result)
        if any(isinstance(x, int) and not -(2**31) <= x < 2**31 for x in numbers):
            return Answer(error=TOO_LARGE)
        return Answer(tuple(map(float, numbers)))

    def c(self, name: str, numbers: Sequence[float]) -> Answer:
        """The answer in C."""
        function = self.functions[name]
        n = len(_leaves(type_of(hints_of(function)["return"]), ""))
        given, taken = (c_double * max(len(numbers), 1))(*numbers), (c_double * max(n, 1))()
        why = create_string_buffer(_WHY)
        call = getattr(self._library, f"call_{name}")
        call.restype, call.argtypes = c_int, [POINTER(c_double), POINTER(c_double), POINTER(c_char)]
        if call(given, taken, why):
            return Answer(error=why.value.decode())
        return Answer(tuple(taken)[:n])


def c_text(functions: dict[str, FunctionType]) -> str:
    """Functions in C, with a function `call_...` for each that takes and gives plain numbers."""
    program = Program(*functions.values())
    program.check()
    emitter = Emitter(program.functions.values())
    made = {name: program.function(function) for name, function in functions.items()}
    shims = [_shim(emitter, name, function) for name, function in made.items()]
    return "\n\n".join([_INCLUDES, emitter.text(), *shims]) + "\n"


def _shim(emitter: Emitter, name: str, function: Function) -> str:
    lines, place = ["Error error[1] = {{0}};"], 0
    for argument, type_ in function.arguments.items():
        argument = in_c(argument)
        lines.append(f"{emitter.type(type_)} given_{argument};")
        for leaf, part in _leaves(type_, f"given_{argument}"):
            cast = "" if part == FLOAT else "(int)"
            lines.append(f"{leaf} = {cast}in[{place}];")
            place += 1
    call = emitter.call(function, [f"given_{in_c(argument)}" for argument in function.arguments])
    lines.append(f"const {emitter.type(function.returns)} result = {call};".replace("\x02", " "))
    leaves = _leaves(function.returns, "result")
    lines += [f"out[{i}] = {leaf};" for i, (leaf, _) in enumerate(leaves)]
    lines += [f"memcpy(why, error->why.text, {_WHY});", "(void)in; return error->raised;"]
    body = "\n".join(f"    {line}" for line in lines)
    head = f"int call_{name}(const double in[], double out[], char why[])"
    return f"{head};\n{head} {{\n{body}\n}}"


def _leaves(type_: Type, name: str) -> list[tuple[str, Scalar]]:
    """The numbers in something of a type, and their types."""
    if isinstance(type_, Scalar):
        return [(name, type_)]
    return [leaf for suffix, part in members(type_) for leaf in _leaves(part, name + suffix)]


def _made(hint: Any, values: Any) -> Any:
    """A value of a type from the next numbers."""
    type_ = type_of(hint)
    if isinstance(type_, Scalar):
        plain = hint if isinstance(hint, type) else float
        number = next(values)
        return int(number) if issubclass(plain, IntEnum) else plain(number)
    if isinstance(type_, Array) and type_.made is Vector:
        return Vector([next(values) for _ in range(type_.n)])
    if isinstance(type_, Array) and type_.made is Matrix:
        return Matrix([[next(values) for _ in parts_of(part)] for part in parts_of(type_)])
    if isinstance(type_, Record) and type_.made:
        return type_.made(*(_made(part, values) for part in hints_of(type_.made).values()))
    return tuple(_made(part, values) for part in hint.__args__)


def _flat(value: Any) -> list[float]:
    if isinstance(value, tuple):
        return [number for part in value for number in _flat(part)]
    return [value]


def sizes_of(function: FunctionType) -> list[Any]:
    """The types of all numbers that a function takes."""
    hints = hints_of(function)
    hints.pop("return")
    return [part for hint in hints.values() for _, part in _leaves(type_of(hint), "")]
