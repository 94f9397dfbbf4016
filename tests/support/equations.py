"""The equations of a component, compiled from their translation and called from Python."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from ctypes import CDLL, Array, Structure, byref, c_char, c_char_p, c_double, c_int, c_size_t
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from fmus.discovery import source_of
from fmus.native.translator import translated
from fmus.ports.definition import Definition
from fmus.ports.groups import Nothing, count_values, form, hints_of, is_record, is_whole, parts_of

ROOT = Path(__file__).parents[2]
RUNTIME = ROOT / "fmus/native/runtime"

#: The function in C that calls each hook, its arguments after parameters, and where its result is.
_CALLED = {
    "check": ("check", (), None),
    "check_state": ("check_state", ("state",), None),
    "start": ("start", ("inputs", "t", "state"), "state"),
    "credible": ("credible", ("state", "inputs"), None),
    "restarted": ("restart", ("state", "inputs"), "state"),
    "derive": ("derive", ("state", "inputs", "t", "derived"), "derived"),
    "outputs": ("evaluate", ("state", "derived", "inputs", "t", "outputs"), "outputs"),
    "update": ("update", ("state", "derived", "inputs", "t", "h"), "state"),
}

_SHIM = """
#include "equations.c"
#define OUT __attribute__((visibility("default")))
#define P model_parameters *p
#define S model_state *s
#define I model_inputs *i
#define D model_derived *d
#define O model_outputs *o
#define E Error *e
OUT void check(P, E) { model_check(p, e); }
OUT void check_state(P, S, E) { model_check_state(p, s, e); }
OUT void start(P, I, double t, S, E) { model_start(p, i, t, s, e); }
OUT int credible(P, S, I, E) { return model_credible(p, s, i, e); }
OUT void restart(P, S, I, E) { model_restart(p, s, i, e); }
OUT void derive(P, S, I, double t, D, E) { model_derive(p, s, i, t, d, e); }
OUT void evaluate(P, S, D, I, double t, O, E) { model_evaluate(p, s, d, i, t, o, e); }
OUT void update(P, S, D, I, double t, double h, E) { model_update(p, s, d, i, t, h, e); }
OUT void measure(P, double *n, O, E) { model_measure(p, n, o, e); }
OUT unsigned long seed(P, E) { return model_seed(p, e); }
OUT const char *restarted(void) { return MODEL_RESTARTED; }
"""

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-unused-function")


class Message(Structure):
    """The message of text.c."""

    _fields_ = (("characters", c_int), ("length", c_size_t), ("text", c_char * 2001))


class Error(Structure):
    """The Error of arithmetic.h."""

    _fields_ = (("raised", c_int), ("why", Message))


def is_series(kind: Any) -> bool:
    """True if a type is a tuple, a vector or a matrix: a series of parts without names."""
    return parts_of(kind) is not None and not is_record(kind)


@cache
def structure(kind: Any) -> Any:
    """A type of the equations as ctypes has it."""
    kind = form(kind)
    if kind is float:
        return c_double
    if kind is bool or is_whole(kind):
        return c_int
    if is_series(kind):
        parts = [(f"x{i}", structure(k)) for i, k in enumerate(parts_of(kind) or ())]
    else:
        parts = [(name, structure(k)) for name, k in hints_of(kind).items()]
    return type("Part", (Structure,), {"_fields_": parts})


@cache
def series(kind: Any) -> Any:
    """A type as inputs, states and outputs are kept: all its numbers as doubles."""
    parts = hints_of(kind).values() if isinstance(kind, type) else [kind]
    size = sum(map(count_values, parts))
    return type("Series", (Structure,), {"_fields_": [("v", c_double * size)]})


def listed(kind: Any, value: Any) -> Any:
    """A value as inputs, states and outputs are kept."""
    made = series(kind)()
    made.v[:] = flat(value)
    return made


def filled(kind: Any, value: Any) -> Any:
    """A value in a structure of its type."""
    kind, made = form(kind), structure(kind)
    if not issubclass(made, Structure):
        return made(value)
    kinds = parts_of(kind) if is_series(kind) else hints_of(kind).values()
    assert kinds is not None
    return made(*(filled(k, v) for k, v in zip(kinds, value, strict=True)))


def flat(value: Any) -> list[float]:
    """All numbers of a value, of a structure of ctypes or of a tuple."""
    if isinstance(value, Structure):
        value = [getattr(value, name) for name, *_ in value._fields_]
    elif isinstance(value, Array):
        value = list(value)
    if isinstance(value, (float, int)):
        return [value]
    return [number for part in value for number in flat(part)]


class Equations:
    """A component's hooks in both languages."""

    def __init__(self, definition: Definition) -> None:
        self.said = definition.behaviour
        folder = Path(mkdtemp(prefix="auv_fmu_equations_"))
        (folder / "equations.c").write_text(translated(definition))
        (folder / "shim.c").write_text(_SHIM)
        command = ["cc", *FLAGS, "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-I", str(RUNTIME)]
        library = folder / "equations.so"
        subprocess.run([*command, "-o", library, folder / "shim.c", "-lm"], check=True)
        self.library = CDLL(str(library))
        self.library.restarted.restype = c_char_p

    def kind(self, argument: str) -> Any:
        """The type of an argument of hooks."""
        return float if argument in ("t", "h") else getattr(self.said, argument) or Nothing

    def passed(self, argument: str, value: Any = None) -> Any:
        """An argument of a function in C; None: one without a value."""
        kind = self.kind(argument)
        if argument in ("parameters", "derived", "t", "h"):
            return structure(kind)() if value is None else filled(kind, value)
        return series(kind)() if value is None else listed(kind, value)

    def c(self, hook: str, **given: Any) -> tuple[str, list[str]]:
        """The exception of a hook in C, or else the numbers that it returns."""
        name, taken, result = _CALLED[hook]
        passed = {n: self.passed(n, given.get(n)) for n in ("parameters", *taken)}
        error = Error()
        arguments = [a if isinstance(a, c_double) else byref(a) for a in passed.values()]
        returned = getattr(self.library, name)(*arguments, byref(error))
        if error.raised:
            return error.why.text.decode(), []
        if hook == "credible":
            return "", bits([returned])
        return "", bits(flat(passed[result])) if result else []

    def python(self, hook: str, **given: Any) -> Any:
        """The result of a hook in Python."""
        function: Any = self.said.hooks[hook]
        return function(**{name: given[name] for name in self.said.arguments(hook)})


@cache
def equations(name: str) -> Equations:
    """Compiled once a run of the tests."""
    return Equations(source_of(name).definition)


def bits(numbers: Sequence[float]) -> list[str]:
    """Numbers by their bits, except that every NaN is the same."""
    return [float(number).hex() for number in numbers]
