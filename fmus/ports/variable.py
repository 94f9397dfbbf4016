"""Ports from the fields of a class: what `Annotated` says of a field, and what follows from it.

A component in one file declares its ports as NamedTuples, whose fields have a type, a start value
and a :class:`Variable`:

    class Inputs(NamedTuple):
        u: Annotated[float, Variable("V", "Voltage")] = 0.0
        y: Annotated[Vector, 2, Variable("m", "Position", members=("x", "z"))]

gives the ports `u`, `y.x` and `y.z`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple, get_args, get_origin

from auv_fmu.arrays import Matrix, Vector
from fmus.ports.groups import Field, ParameterSet, check_type, fields_of, is_record, word
from fmus.ports.port import POSITIVE, Misdeclared, Port, Refusal

__all__ = ("POSITIVE", "Refusal", "Variable", "declared")


@dataclass(frozen=True)
class Variable:
    """What a field says of its ports besides name, type and start value.

    Attributes:
        unit: of a float, as :mod:`fmus.ports.units` reads it; "1" for none, "" if it is not known.
        description: one line.
        minimum, maximum: inclusive bounds of an input or a parameter.
        tunable: of a parameter: whether it may change during a run.
        members: names of the elements of a vector or a tuple; without them these have numbers.
        feedthrough: of an output: the inputs that it depends on without a state between, or
            `time`; None: all inputs if `begin` takes them, else none.

    """

    unit: str = "1"
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    tunable: bool = False
    members: tuple[str, ...] = ()
    feedthrough: tuple[str, ...] | None = None


class _Part(NamedTuple):
    """One number of a field."""

    name: str  #: after the field's
    label: str  #: in its description
    type: Any
    start: Any


#: What FMI calls the types of numbers, and where a number starts if nothing is said.
_TYPES: dict[Any, tuple[str, Any]] = {
    float: ("Real", 0.0),
    int: ("Integer", 0),
    bool: ("Boolean", False),
}

#: What is said only of some.
_ONLY = {"feedthrough": "output", "tunable": "parameter"}


def declared(made: Any, causality: str, direct: tuple[str, ...] = ()) -> dict[str, Field]:
    """The ports of each field of a class, by the names of its fields.

    Args:
        made: the class.
        causality: of the ports: `input`, `output` or `parameter`.
        direct: what outputs depend on that do not say it: fields of the inputs, which stand in
            `feedthrough` of the ports.

    Raises:
        Misdeclared: a field is wrong, or says too little.

    """
    return _declared(made, causality, direct, "", None)


def _declared(
    made: Any, causality: str, direct: tuple[str, ...], prefix: str, given: Any
) -> dict[str, Field]:
    name = getattr(made, "__name__", str(made))
    if not (isinstance(made, type) and hasattr(made, "_field_defaults")):
        raise _wrong((name,), f"is no NamedTuple; write class {name}(NamedTuple)")
    starts = dict(made._field_defaults) if given is None else given._asdict()
    fields: dict[str, Field] = {}
    for field, hint in fields_of(made).items():
        place, start = (name, field), starts.get(field)
        inner, notes = _annotated(hint)
        if is_record(inner):
            if start is not None and not isinstance(start, inner):
                raise _wrong(place, f"starts with {start!r:.40}, which is no {inner.__name__}")
            below = _declared(inner, causality, direct, f"{prefix}{field}.", start)
            fields[field] = ParameterSet(inner, **below)
            continue
        said = _said(notes, causality, place, inner)
        check_type(hint, *place)
        parts = list(_parts(inner, notes, said, start, place))
        if causality == "parameter" and any(part.start is None for part in parts):
            raise _wrong(place, "has no default value, which a parameter starts with")
        if causality == "output" and said.feedthrough is None:
            said = replace(said, feedthrough=direct)
        named = [(f"{prefix}{field}{part.name}", part) for part in parts]
        ports = [_port(name, causality, said, part, place) for name, part in named]
        fields[field] = tuple(ports) if parts[0].name else ports[0]
    return fields


def _wrong(place: tuple[str, ...], why: str) -> Misdeclared:
    return Misdeclared(f"{'.'.join(place)} {why}", *place)


def _said(notes: tuple[Any, ...], causality: str, place: tuple[str, ...], inner: Any) -> Variable:
    """What a field says of its ports, if that can be said of them."""
    found = [note for note in notes if isinstance(note, Variable)]
    if len(found) != 1:
        example = f'{place[-1]}: Annotated[{_word(inner)}, Variable("m", "What it is")]'
        raise _wrong(place, f"has no unit and no description; write {example}")
    [said] = found
    for name, of in _ONLY.items():
        if getattr(said, name) not in (None, False) and causality != of:
            raise _wrong(place, f"is no {of}, and {name} is for {of}s")
    if causality == "output" and (said.minimum, said.maximum) != (None, None):
        raise _wrong(place, "is an output; minimum and maximum are for inputs and parameters")
    for name in ("feedthrough", "members"):
        names = getattr(said, name)
        if names is not None and not _are_names(names):
            raise _wrong(place, f"has the {name} {names!r:.40}; write a tuple of different names")
    if not isinstance(said.description, str):
        raise _wrong(place, f"has the description {said.description!r:.40}; write a text")
    return said


def _are_names(names: object) -> bool:
    """Whether something is a tuple of names, each once."""
    return (
        isinstance(names, tuple)
        and all(isinstance(name, str) and name.isidentifier() and name.isascii() for name in names)
        and len({*names}) == len(names)
    )


def _annotated(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """A type without what is noted of it, and that."""
    if get_origin(hint) is Annotated:
        inner, *notes = get_args(hint)
        return inner, tuple(notes)
    return hint, ()


def _word(hint: Any) -> str:
    """A type as it is written."""
    if hint in (Vector, Matrix):
        return f"{hint.__name__}, {'3' if hint is Vector else '2, 3'}"
    return word(hint)


def _parts(
    hint: Any, notes: tuple[Any, ...], said: Variable, start: Any, place: tuple[str, ...]
) -> Iterator[_Part]:
    """The numbers of a field, in their order."""
    shape, number = _shape(hint, notes, place)
    if said.members and (len(shape) != 1 or shape[0] != len(said.members)):
        size = " x ".join(map(str, shape)) or "one"
        raise _wrong(place, f"has {len(said.members)} members for {size} numbers")
    names = [f".{member}" for member in said.members] or [
        f"[{','.join(map(str, at))}]" if at else "" for at in _places(shape)
    ]
    starts = [None] * len(names) if start is None else list(_flat(start, shape, place))
    for name, first in zip(names, starts):
        yield _Part(name, name.strip(".[]"), number, first)


def _shape(
    hint: Any, notes: tuple[Any, ...], place: tuple[str, ...]
) -> tuple[tuple[int, ...], Any]:
    """How many numbers a type has along each dimension, and of which type."""
    if hint in (Vector, Matrix):
        return tuple(note for note in notes if type(note) is int), float
    if get_origin(hint) is tuple:
        elements = [*dict.fromkeys(get_args(hint))]
        if len(elements) != 1 or get_args(hint) == ((),):
            raise _wrong(place, "has elements of several types; write a NamedTuple")
        below, number = _shape(*_annotated(elements[0]), place)
        return (len(get_args(hint)), *below), number
    if is_record(hint):
        raise _wrong(place, "is a tuple of NamedTuples; write a NamedTuple of them")
    return (), hint


def _places(shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """The indices of all numbers, from one."""
    if not shape:
        yield ()
        return
    for first in range(1, shape[0] + 1):
        yield from ((first, *rest) for rest in _places(shape[1:]))


def _flat(start: Any, shape: tuple[int, ...], place: tuple[str, ...]) -> Iterator[Any]:
    """The numbers of a start value that has this shape."""
    if not shape:
        yield start
    elif not isinstance(start, tuple) or len(start) != shape[0]:
        raise _wrong(place, f"starts with {start!r:.40}, which has not {shape[0]} elements")
    else:
        for part in start:
            yield from _flat(part, shape[1:], place)


def _port(name: str, causality: str, said: Variable, part: _Part, place: tuple[str, ...]) -> Port:
    kind, start, choices, bounds = _meant(part, causality, place)
    if kind != "Real" and said.unit != "1":
        raise _wrong(place, f"is of the type {_word(part.type)}; only a float has a unit")
    variability = "tunable" if said.tunable else "fixed"
    if causality != "parameter":
        variability = "continuous" if kind == "Real" else "discrete"
    minimum, maximum = said.minimum, said.maximum
    if bounds is not None:
        if (minimum, maximum) != (None, None):
            raise _wrong(place, "has a minimum or maximum, but its range is its members")
        minimum, maximum = bounds
    try:
        port = Port(
            name,
            causality,
            variability,
            kind,
            ": ".join(filter(None, (said.description, part.label))),
            (said.unit or None) if kind == "Real" else None,
            start,
            minimum,
            maximum,
            choices,
            tuple(said.feedthrough or ()),
        )
        port.checked(start)
    except Misdeclared as error:
        raise _wrong(place, str(error).removeprefix(f"{name} ")) from None
    except Refusal as refusal:
        raise _wrong(place, f"starts with {refusal}") from None
    return replace(port, start=None) if causality == "output" else port


def _meant(part: _Part, causality: str, place: tuple[str, ...]) -> tuple[str, Any, Any, Any]:
    """FMI's type of a number, its start value, its choices, and bounds that follow from them."""
    number, start = part.type, part.start
    if number in _TYPES:
        kind, zero = _TYPES[number]
        start = zero if start is None else start
        is_whole = kind == "Real" and type(start) is int and abs(start) <= sys.float_info.max
        return kind, float(start) if is_whole else start, {}, None
    members = list(number)
    start = members[0] if start is None else start
    if not isinstance(start, number):
        raise _wrong(place, f"starts with {start!r:.40}, which is no {number.__name__}")
    if causality == "parameter":
        return "String", start.name, {one.name: one for one in members}, None
    if causality == "output":
        return "Integer", int(start), {}, None
    named = {one.name: int(one) for one in members}
    return "Integer", int(start), named, (int(min(members)), int(max(members)))
