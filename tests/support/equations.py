"""The equations of a component, compiled from their translation and called from Python."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from ctypes import CDLL, Array, Structure, byref, c_char, c_char_p, c_double, c_int, c_size_t
from functools import cache
from importlib import import_module
from pathlib import Path
from tempfile import mkdtemp
from types import ModuleType
from typing import Any, get_type_hints

from fmus.discovery import components, source_of
from fmus.native.translator import translated
from fmus.ports.groups import count_values, hints_of, is_record, parts_of

ROOT = Path(__file__).parents[2]
RUNTIME = ROOT / "fmus/native/runtime"

_SHIM = """
#include "equations.c"
#define OUT __attribute__((visibility("default")))
OUT void check(model_parameters *p, Error *e) { model_check(p, e); }
OUT void begin(model_parameters *p, model_inputs *i, double t, model_state *s, model_outputs *o,
               Error *e) { model_begin(p, i, t, s, o, e); }
OUT void advance(model_parameters *p, model_state *s, model_inputs *i, double t, double h, int n,
                 model_outputs *o, Error *e) { model_advance(p, s, i, t, h, n, o, e); }
OUT void derive(model_parameters *p, model_state *s, Error *e) { model_derive(p, s, e); }
OUT void expected(model_parameters *p, model_state *s, model_outputs *o, model_outputs *x, Error *e)
{ model_expected(p, s, o, x, e); }
OUT int credible(model_parameters *p, model_state *s, model_inputs *i, Error *e)
{ return model_credible(p, s, i, e); }
OUT void restart(model_parameters *p, model_state *s, model_inputs *i, Error *e)
{ model_restart(p, s, i, e); }
OUT void measure(model_parameters *p, double *n, model_outputs *o, Error *e)
{ model_measure(p, n, o, e); }
OUT unsigned long seed(model_parameters *p, Error *e) { return model_seed(p, e); }
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
    """Whether a type is a tuple, a vector or a matrix, the parts of which have no names."""
    return parts_of(kind) is not None and not is_record(kind)


@cache
def structure(kind: Any) -> Any:
    """A type of the equations as ctypes has it."""
    if kind is float:
        return c_double
    if kind in (int, bool):
        return c_int
    if is_series(kind):
        parts = [(f"x{i}", structure(k)) for i, k in enumerate(parts_of(kind) or ())]
    else:
        parts = [(name, structure(k)) for name, k in hints_of(kind).items()]
    return type("Part", (Structure,), {"_fields_": parts})


@cache
def series(kind: Any) -> Any:
    """A type as states and outputs are kept: all its numbers as doubles."""
    parts = hints_of(kind).values() if isinstance(kind, type) else [kind]
    size = sum(map(count_values, parts))
    return type("Series", (Structure,), {"_fields_": [("v", c_double * size)]})


def listed(kind: Any, value: Any) -> Any:
    """A value as states and outputs are kept."""
    made = series(kind)()
    made.v[:] = flat(value)
    return made


def filled(kind: Any, value: Any) -> Any:
    """A value in a structure of its type."""
    made = structure(kind)
    if not issubclass(made, Structure):
        return made(value)
    kinds = parts_of(kind) if is_series(kind) else hints_of(kind).values()
    assert kinds is not None
    values = value.values() if isinstance(value, dict) else value
    return made(*(filled(k, v) for k, v in zip(kinds, values, strict=True)))


def flat(value: Any) -> list[float]:
    """All numbers of a value, of a structure of ctypes or of a tuple."""
    if isinstance(value, Structure):
        value = [getattr(value, name) for name, *_ in value._fields_]
    elif isinstance(value, Array):
        value = list(value)
    elif isinstance(value, dict):
        value = value.values()
    if isinstance(value, (float, int)):
        return [value]
    return [number for part in value for number in flat(part)]


class Equations:
    """A component's functions in both languages."""

    def __init__(self, name: str) -> None:
        self.behaviour: ModuleType = import_module(f"{components()[name]}.behaviour")
        folder = Path(mkdtemp(prefix="auv_fmu_equations_"))
        (folder / "equations.c").write_text(translated(source_of(name).definition))
        (folder / "shim.c").write_text(_SHIM)
        command = ["cc", *FLAGS, "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-I", str(RUNTIME)]
        library = folder / "equations.so"
        subprocess.run([*command, "-o", library, folder / "shim.c", "-lm"], check=True)
        self.library = CDLL(str(library))
        self.library.restarted.restype = c_char_p
        hints = {**hints_of(self.behaviour.begin), **hints_of(self.behaviour.advance)}
        self.parameters, self.state = hints["parameters"], hints["state"]
        self.inputs = hints.get("inputs", tuple[()])
        self.derived = hints.get("derived")
        self.outputs = self.behaviour.Outputs
        derived = [structure(self.derived)] if self.derived else []
        parts = [(f"x{i}", kind) for i, kind in enumerate([series(self.state), *derived])]
        self._kept = type("Kept", (Structure,), {"_fields_": parts})

    def kept(self, state: Any = None) -> Any:
        """The state as the component keeps it: what is derived from it is not filled in."""
        made = self._kept()
        if state is not None:
            made.x0 = listed(self.state, state)
        return made

    def result(self, name: str, *arguments: Any) -> int:
        """What a function gives that raises nothing."""
        error = Error()
        result: int = getattr(self.library, name)(*_passed(arguments), byref(error))
        assert not error.raised
        return result

    def call(self, name: str, *arguments: Any) -> str:
        """Call a function with structures and numbers; what it raised."""
        error = Error()
        getattr(self.library, name)(*_passed(arguments), byref(error))
        return error.why.text.decode() if error.raised else ""

    def python(self, name: str, **given: Any) -> Any:
        """Call the function of the same name with those arguments that it has."""
        function = getattr(self.behaviour, name)
        return function(**{n: given[n] for n in get_type_hints(function) if n != "return"})


def _passed(arguments: Sequence[Any]) -> list[Any]:
    kinds = {float: c_double, int: c_int}
    return [kinds[type(a)](a) if type(a) in kinds else byref(a) for a in arguments]


@cache
def equations(name: str) -> Equations:
    """Compiled once a run of the tests."""
    return Equations(name)


def bits(numbers: Sequence[float]) -> list[str]:
    """Numbers by their bits, but for NaN, of which there is one."""
    return [float(number).hex() for number in numbers]
