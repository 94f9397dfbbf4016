"""Ports from the fields of a class, which `Annotated` describes."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any, NamedTuple, get_args, get_origin

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.variable import Refusal, Variable
from fmus.ports.groups import check_type, fields_of, is_record, sizes_in, split, word
from fmus.ports.port import Array, Misdeclared, Port


class _Part(NamedTuple):
    """One number of a field."""

    member: str  #: its name within the field; empty if it is the whole field
    name: str  #: name of its port
    unit: str
    type: Any
    start: Any


#: Names of types in FMI, and default start values.
_TYPES: dict[Any, tuple[str, Any]] = {
    float: ("Real", 0.0),
    int: ("Integer", 0),
    bool: ("Boolean", False),
}

#: Attributes that only one causality may have.
_ONLY = {
    "feedthrough": "output", "initially": "output", "tunable": "parameter", "terminal": "input",
}  # fmt: skip

#: An input, or a group of them, in `feedthrough`.
_SOURCE = re.compile(r"[\w.,\[\]{}]+", re.ASCII)


def declared(
    made: Any,
    causality: str,
    direct: tuple[str, ...] = (),
    initial: tuple[str, ...] = (),
    prefix: str = "",
    given: Any = None,
) -> dict[str, tuple[Port, ...]]:
    """Return the ports of each field of a class, by the names of its fields.

    Args:
        made: the class, a NamedTuple.
        causality: of the ports: `input`, `output`, `parameter` or `local`.
        direct, initial: defaults of `feedthrough` and `initially` of outputs.
        prefix: prefix of the names of the ports.
        given: start values, if they differ from the defaults of the class.

    Raises:
        Misdeclared: a field is invalid or incomplete.

    """
    starts = dict(made._field_defaults) if given is None else given._asdict()
    fields: dict[str, tuple[Port, ...]] = {}
    for field, hint in fields_of(made).items():
        place, start = (made.__name__, field), starts.get(field)
        inner, notes = split(hint)
        if is_record(inner):
            if start is not None and not isinstance(start, inner):
                raise _wrong(place, f"starts with {start!r:.40}, which is no {inner.__name__}")
            before = prefix + _prefix(notes, field, place)
            below = declared(inner, causality, direct, initial, before, start)
            fields[field] = tuple(chain(*below.values()))
            continue
        variable = _said(notes, causality, place, inner)
        check_type(hint, *place)
        parts = list(_parts(inner, notes, variable, start, prefix, place))
        if causality == "parameter" and any(part.start is None for part in parts):
            raise _wrong(place, "has no default value, which a parameter starts with")
        if causality == "output":
            if variable.feedthrough is None:
                variable = replace(variable, feedthrough=direct)
            if variable.initially is None:
                variable = replace(variable, initially=initial)
        ports = [_port(causality, variable, part, place) for part in parts]
        if len({part.unit for part in parts}) == 1 and "{}" not in (variable.name or ""):
            shape = _shape(inner, notes, place)[0]
            array = Array(prefix + (variable.name or field), variable.description, shape)
            ports = [replace(port, array=array if shape else None) for port in ports]
        fields[field] = tuple(ports)
    return fields


def _wrong(place: tuple[str, ...], why: str) -> Misdeclared:
    return Misdeclared(f"{'.'.join(place)} {why}", *place)


def _prefix(notes: tuple[Any, ...], field: str, place: tuple[str, ...]) -> str:
    """Return the prefix of names for the fields of a NamedTuple that is a field itself."""
    variables = [note for note in notes if isinstance(note, Variable)]
    if variables and variables != [Variable(name=variables[0].name)]:
        raise _wrong(place, "is a NamedTuple, and its Variable may have only a name")
    name = variables[0].name if variables else None
    return f"{field}." if name is None else f"{name}." if name else ""


def _said(notes: tuple[Any, ...], causality: str, place: tuple[str, ...], inner: Any) -> Variable:
    """Return the Variable of a field, with its members; refuse an invalid one."""
    variables = [note for note in notes if isinstance(note, Variable)]
    if not variables and causality == "local":
        # Only a float may have a unit.
        unit = "" if _shape(inner, notes, place)[1] is float else "1"
        variables = [Variable(unit, place[-1])]
    if len(variables) != 1:
        example = f'{place[-1]}: Annotated[{_word(inner)}, Variable("m", "What it is")]'
        raise _wrong(place, f"has no unit and no description; write {example}")
    [variable] = variables
    for name, role in _ONLY.items():
        if getattr(variable, name) not in (None, False) and causality != role:
            raise _wrong(place, f"is no {role}, and {name} is for {role}s")
    terminal = variable.terminal
    if terminal is not None and not (isinstance(terminal, str) and _is_member(terminal)):
        raise _wrong(place, f"has the terminal {terminal!r:.40}; write a name")
    if causality == "output" and (variable.minimum, variable.maximum) != (None, None):
        raise _wrong(place, "is an output; minimum and maximum are for inputs and parameters")
    for name in ("feedthrough", "initially"):
        names = getattr(variable, name)
        if names is not None and not _are_different(names, _is_source):
            raise _wrong(place, f"has the {name} {names!r:.40}; write a tuple of different names")
    if isinstance(variable.unit, Mapping):
        if variable.members:
            raise _wrong(place, "has its members twice: with their units, and without")
        variable = replace(variable, members=tuple(variable.unit))
    if not _are_different(variable.members, _is_member):
        why = f"has the members {variable.members!r:.40}; write a tuple of different names"
        raise _wrong(place, why)
    if not isinstance(variable.description, str):
        raise _wrong(place, f"has the description {variable.description!r:.40}; write a text")
    return variable


def _are_different(names: object, is_one: Any) -> bool:
    """Return True for a tuple of different names of a kind."""
    return isinstance(names, tuple) and all(map(is_one, names)) and len({*names}) == len(names)


def _is_source(name: object) -> bool:
    return isinstance(name, str) and _SOURCE.fullmatch(name) is not None


def _is_member(name: object) -> bool:
    if isinstance(name, str):
        return name.isidentifier() and name.isascii()
    return type(name) is int and name >= 0


def _word(hint: Any) -> str:
    """Return the text of a type."""
    if hint in (Vector, Matrix):
        return f"{hint.__name__}, {'3' if hint is Vector else '2, 3'}"
    return word(hint)


def _parts(
    hint: Any,
    notes: tuple[Any, ...],
    variable: Variable,
    start: Any,
    prefix: str,
    place: tuple[str, ...],
) -> Iterator[_Part]:
    """Yield the numbers of a field in order."""
    shape, number = _shape(hint, notes, place)
    if variable.members and (len(shape) != 1 or shape[0] != len(variable.members)):
        size = " x ".join(map(str, shape)) or "one"
        raise _wrong(place, f"has {len(variable.members)} members for {size} numbers")
    members = variable.members or [",".join(map(str, at)) for at in _places(shape)]
    starts = [None] * len(members) if start is None else list(_flat(start, shape, place))
    base = prefix + (place[-1] if variable.name is None else variable.name)
    for member, first in zip(members, starts):
        unit = variable.unit[member] if isinstance(variable.unit, Mapping) else variable.unit
        yield _Part(str(member), _named(base, member, variable.members), unit, number, first)


def _named(base: str, member: str | int, members: tuple[str | int, ...]) -> str:
    """Return the name of a member of a group."""
    if "{}" in base:
        return base.replace("{}", str(member))
    if member == "":
        return base
    return f"{base}.{member}" if members and isinstance(member, str) else f"{base}[{member}]"


def _shape(
    hint: Any, notes: tuple[Any, ...], place: tuple[str, ...]
) -> tuple[tuple[int, ...], Any]:
    """Return the sizes of a type along each dimension, and the type of its numbers."""
    if hint in (Vector, Matrix):
        return sizes_in(notes), float
    if get_origin(hint) is tuple:
        elements = [*dict.fromkeys(get_args(hint))]
        if len(elements) != 1 or get_args(hint) == ((),):
            raise _wrong(place, "has elements of several types; write a NamedTuple")
        below, number = _shape(*split(elements[0]), place)
        return (len(get_args(hint)), *below), number
    if is_record(hint):
        raise _wrong(place, "is a tuple of NamedTuples; write a NamedTuple of them")
    return (), hint


def _places(shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Yield the indices of all numbers, from one."""
    if not shape:
        yield ()
        return
    for first in range(1, shape[0] + 1):
        yield from ((first, *rest) for rest in _places(shape[1:]))


def _flat(start: Any, shape: tuple[int, ...], place: tuple[str, ...]) -> Iterator[Any]:
    """Yield the numbers of a start value of this shape."""
    if not shape:
        yield start
    elif not isinstance(start, tuple) or len(start) != shape[0]:
        raise _wrong(place, f"starts with {start!r:.40}, which has not {shape[0]} elements")
    else:
        for part in start:
            yield from _flat(part, shape[1:], place)


def _port(causality: str, variable: Variable, part: _Part, place: tuple[str, ...]) -> Port:
    kind, start, choices = _fmi_type(part, place)
    if kind != "Real" and part.unit != "1":
        raise _wrong(place, f"is of the type {_word(part.type)}; only a float has a unit")
    variability = "tunable" if variable.tunable else "fixed"
    if causality != "parameter":
        variability = "continuous" if kind == "Real" else "discrete"
    label = "" if variable.name and "{}" in variable.name else part.member
    try:
        port = Port(
            part.name,
            causality,
            variability,
            kind,
            ": ".join(filter(None, (variable.description, label))),
            (part.unit or None) if kind == "Real" else None,
            start,
            variable.minimum,
            variable.maximum,
            choices,
            part.type.__name__ if choices else "",
            tuple(name.replace("{}", part.member) for name in variable.feedthrough or ()),
            tuple(name.replace("{}", part.member) for name in variable.initially or ()),
            terminal=variable.terminal or "",
        )
        port.checked(start)
    except Misdeclared as error:
        raise _wrong(place, str(error).removeprefix(f"{part.name} ")) from None
    except Refusal as refusal:
        raise _wrong(place, f"starts with {refusal}") from None
    return replace(port, start=None) if causality in ("output", "local") else port


def _fmi_type(part: _Part, place: tuple[str, ...]) -> tuple[str, Any, dict[str, int]]:
    """Return FMI's type of a number, its start value, and its choices."""
    number, start = part.type, part.start
    if number in _TYPES:
        kind, zero = _TYPES[number]
        start = zero if start is None else start
        is_whole = kind == "Real" and type(start) is int and abs(start) <= sys.float_info.max
        return kind, float(start) if is_whole else start, {}
    members = list(number)
    start = members[0] if start is None else start
    if not isinstance(start, number):
        raise _wrong(place, f"starts with {start!r:.40}, which is no {number.__name__}")
    choices = {member.name.lower(): member for member in members}
    if len(choices) < len(members):
        raise _wrong(place, f"has choices of {number.__name__} that differ only in capitals")
    return "Enumeration", int(start), choices
