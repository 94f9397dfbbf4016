"""The equations of a component, compiled from their translation and called from Python."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from ctypes import (
    CDLL,
    Structure,
    byref,
    c_char,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_ulong,
)
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from auv_fmu.variable import Refusal
from fmus.discovery import source_of
from fmus.native.translator import translated
from fmus.ports.groups import Nothing, count_values, form, hints_of, is_record, parts_of
from fmus.python.callbacks import LONGEST_MESSAGE

ROOT = Path(__file__).parents[2]
RUNTIME = ROOT / "fmus/native/runtime"

_SHIM = """
#include "equations.c"
#define OUT __attribute__((visibility("default")))
#define P model_parameters *p
#define S model_state *s
#define D model_derived *d
#define I model_inputs *i
#define O model_outputs *o
#define E Error *e
OUT void check(P, E) { model_check(p, e); }
OUT void check_state(P, S, E) { model_check_state(p, s, e); }
OUT unsigned long seed(P, E) { return model_seed(p, e); }
OUT void start(P, I, double t, S, E) { model_start(p, i, t, s, e); }
OUT int credible(P, S, I, E) { return model_credible(p, s, i, e); }
OUT void restarted(P, S, I, E) { model_restart(p, s, i, e); }
OUT void derive(P, S, I, double t, D, E) { model_derive(p, s, i, t, d, e); }
OUT void outputs(P, S, D, I, double t, O, E) { model_evaluate(p, s, d, i, t, o, e); }
OUT void update(P, S, D, I, double t, double h, E) { model_update(p, s, d, i, t, h, e); }
OUT void measured(P, double *n, O, E) { model_measure(p, n, o, e); }
OUT const char *logged(void) { return MODEL_RESTARTED; }
"""

#: What the compiled hooks take, and which of it has their result; others return it.
_TAKES = {
    "check": ("parameters",),
    "check_state": ("parameters", "state"),
    "seed": ("parameters",),
    "start": ("parameters", "inputs", "t", "state"),
    "credible": ("parameters", "state", "inputs"),
    "restarted": ("parameters", "state", "inputs"),
    "derive": ("parameters", "state", "inputs", "t", "derived"),
    "outputs": ("parameters", "state", "derived", "inputs", "t", "outputs"),
    "update": ("parameters", "state", "derived", "inputs", "t", "h"),
    "measured": ("parameters", "n", "outputs"),
}
_RESULTS = {
    "start": "state",
    "restarted": "state",
    "derive": "derived",
    "outputs": "outputs",
    "update": "state",
    "measured": "outputs",
}

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-unused-function")


class Message(Structure):
    """The message of text.c."""

    _fields_ = (("characters", c_int), ("length", c_size_t), ("text", c_char * 2001))


class Error(Structure):
    """The Error of arithmetic.h."""

    _fields_ = (("raised", c_int), ("why", Message))


def is_series(kind: Any) -> bool:
    """Whether a type is a tuple, a vector or a matrix, the parts of which have no names."""
    return parts_of(kind) is not None and not is_record(kind)


def structure(kind: Any) -> Any:
    """A type of the equations as ctypes has it."""
    return _structure(form(kind))


@cache
def _structure(kind: Any) -> Any:
    if kind is float:
        return c_double
    if not is_series(kind) and not is_record(kind):
        return c_int
    if is_series(kind):
        parts = [(f"x{i}", structure(k)) for i, k in enumerate(parts_of(kind) or ())]
    else:
        parts = [(name, structure(k)) for name, k in hints_of(kind).items()]
    return type("Part", (Structure,), {"_fields_": parts})


def listed(kind: Any, value: Any) -> Any:
    """A value as inputs, states and outputs are kept: all its numbers as doubles."""
    return (c_double * count_values(kind))(*flat(value))


def filled(kind: Any, value: Any) -> Any:
    """A value in a structure of its type."""
    kind = form(kind)
    made = structure(kind)
    if not issubclass(made, Structure):
        return made(value)
    kinds = parts_of(kind)
    assert kinds is not None
    return made(*(filled(k, v) for k, v in zip(kinds, value, strict=True)))


def flat(value: Any) -> list[float]:
    """All numbers of a value, of a structure of ctypes or of a tuple."""
    if isinstance(value, Structure):
        value = [getattr(value, name) for name, *_ in value._fields_]
    if isinstance(value, (float, int)):
        return [value]
    return [number for part in value for number in flat(part)]


#: What something comes to: what it raises, or the bits of its numbers.
Outcome = tuple[str, list[str]]


def outcome(made: Any) -> Outcome:
    """What something comes to that raises nothing."""
    return "", bits(flat(() if made is None else made))


class Equations:
    """A component's hooks in both languages."""

    def __init__(self, name: str) -> None:
        self.behaviour = source_of(name).definition.behaviour
        folder = Path(mkdtemp(prefix="auv_fmu_equations_"))
        (folder / "equations.c").write_text(translated(source_of(name).definition))
        (folder / "shim.c").write_text(_SHIM)
        command = ["cc", *FLAGS, "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-I", str(RUNTIME)]
        library = folder / "equations.so"
        subprocess.run([*command, "-o", library, folder / "shim.c", "-lm"], check=True)
        self.library = CDLL(str(library))
        self.library.logged.restype = c_char_p
        self.library.seed.restype = c_ulong

    def of_c(self, hook: str, **given: Any) -> Outcome:
        """What a compiled hook comes to."""
        passed = {what: self._passed(what, given.get(what)) for what in _TAKES[hook]}
        error = Error()
        arguments = (a if isinstance(a, c_double) else byref(a) for a in passed.values())
        returned = getattr(self.library, hook)(*arguments, byref(error))
        if error.raised:
            return error.why.text.decode(), []
        if hook in _RESULTS:
            return outcome(passed[_RESULTS[hook]])
        return outcome(None if hook.startswith("check") else returned)

    def of_python(self, hook: str, **given: Any) -> Outcome:
        """What the hook comes to in Python; a refusal as a slave says it."""
        try:
            return outcome(self.call(hook, **given))
        except Refusal as refusal:
            return str(refusal), []
        except Exception as error:
            return f"{type(error).__name__}: {error}"[:LONGEST_MESSAGE], []

    def call(self, hook: str, **given: Any) -> Any:
        """What the hook returns."""
        function = self.behaviour.hooks[hook]
        assert function is not None
        return function(**{name: given[name] for name in self.behaviour.arguments(hook)})

    def _passed(self, what: str, value: Any) -> Any:
        """An argument, or room for it."""
        if what in ("t", "h"):
            return c_double(value)
        if what == "n":
            return (c_double * len(value))(*value)
        kind = getattr(self.behaviour, what) or Nothing
        if not count_values(kind):
            return (c_double * 1)()
        if what in ("parameters", "derived"):
            return structure(kind)() if value is None else filled(kind, value)
        return (c_double * count_values(kind))() if value is None else listed(kind, value)


@cache
def equations(name: str) -> Equations:
    """Compiled once a run of the tests."""
    return Equations(name)


def bits(numbers: Sequence[float]) -> list[str]:
    """Numbers by their bits, but for NaN, of which there is one."""
    return [float(number).hex() for number in numbers]
