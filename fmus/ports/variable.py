"""Ports from the fields of a class: what `Annotated` says of a field, and what follows from it.

A component in one file declares its ports as NamedTuples, whose fields have a type, a start value
and a :class:`Variable`:

    class Inputs(NamedTuple):
        u: Annotated[float, Variable("V", "Voltage")] = 0.0
        y: Annotated[Vector, 2, Variable("m", "Position", members=("x", "z"))]

gives the ports `u`, `y.x` and `y.z`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from auv_fmu.arrays import Matrix, Vector
from fmus.ports.groups import Field, ParameterSet
from fmus.ports.port import POSITIVE, Port, Refusal

__all__ = ("POSITIVE", "Misdeclared", "Refusal", "Variable", "declared")


@dataclass(frozen=True)
class Variable:
    """What a field says of its ports besides name, type and start value.

    Attributes:
        unit: of a float, as :mod:`fmus.ports.units` reads it; "1" for none.
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


class Misdeclared(TypeError):
    """A declaration that cannot be; the text says why.

    Attributes:
        place: the class or the function, and the field, that it is about.

    """

    def __init__(self, place: tuple[str, ...], why: str) -> None:
        """Say what is wrong, and where."""
        self.place = place
        super().__init__(f"{'.'.join(place)}: {why}")


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


def declared(made: Any, causality: str, prefix: str = "", given: Any = None) -> dict[str, Field]:
    """The ports of each field of a class, with a dictionary of its fields.

    Args:
        made: the class.
        causality: of the ports: `input`, `output` or `parameter`.
        prefix: of their names.
        given: a value of the class with other start values than the class's own.

    Raises:
        Misdeclared: a field is wrong, or says too little.

    """
    name = getattr(made, "__name__", str(made))
    if not (isinstance(made, type) and issubclass(made, tuple) and hasattr(made, "_fields")):
        raise Misdeclared((name,), f"is no NamedTuple; write class {name}(NamedTuple)")
    starts = dict(made._field_defaults) if given is None else given._asdict()  # type: ignore[attr-defined]
    fields: dict[str, Field] = {}
    for field, hint in _hints(made).items():
        place, start = (name, field), starts.get(field)
        inner, notes = _annotated(hint)
        if isinstance(inner, type) and hasattr(inner, "_fields"):
            start = _checked_instance(start, inner, place)
            below = declared(inner, causality, f"{prefix}{field}.", start)
            fields[field] = ParameterSet(inner, **below)
            continue
        said = [note for note in notes if isinstance(note, Variable)]
        if len(said) != 1:
            example = f'{field}: Annotated[{_word(inner)}, Variable("m", "What it is")]'
            raise Misdeclared(place, f"has no unit and no description; write {example}")
        parts = list(_parts(inner, notes, said[0], start, place))
        if causality == "parameter" and any(part.start is None for part in parts):
            raise Misdeclared(place, "has no default value, which a parameter starts with")
        _check(said[0], causality, place)
        ports = tuple(
            _port(f"{prefix}{field}{part.name}", causality, said[0], part, place) for part in parts
        )
        is_one = parts[0].name == ""
        fields[field] = ports[0] if is_one else ports
    return fields


def _hints(made: Any) -> dict[str, Any]:
    try:
        return get_type_hints(made, include_extras=True)
    except NameError as error:
        missing = str(error).split("'")[1]
        named = [f for f, hint in made.__annotations__.items() if missing in str(hint)]
        raise Misdeclared((made.__name__, *named[:1]), f"{error}; import it") from None


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
    return hint.__name__ if isinstance(hint, type) and not get_args(hint) else str(hint)


def _checked_instance(start: Any, wanted: type, place: tuple[str, ...]) -> Any:
    if start is not None and not isinstance(start, wanted):
        raise Misdeclared(place, f"starts with {start!r:.40}, which is no {wanted.__name__}")
    return start


def _parts(
    hint: Any, notes: tuple[Any, ...], said: Variable, start: Any, place: tuple[str, ...]
) -> Iterator[_Part]:
    """The numbers of a field, in their order."""
    shape, number = _shape(hint, notes, place)
    if said.members and (len(shape) != 1 or shape[0] != len(said.members)):
        size = " x ".join(map(str, shape)) or "one"
        raise Misdeclared(place, f"has {len(said.members)} members for {size} numbers")
    names = [f".{member}" for member in said.members] or [
        f"[{','.join(map(str, at))}]" if at else "" for at in _places(shape)
    ]
    starts = [None] * len(names) if start is None else list(_flat(start, shape, place))
    for name, first in zip(names, starts):
        yield _Part(name, name.strip(".[]"), number, first)


def _shape(hint: Any, notes: tuple[Any, ...], place: tuple[str, ...]) -> tuple[tuple[int, ...], Any]:
    """How many numbers a type has along each dimension, and of which type."""
    if hint in (Vector, Matrix):
        sizes = tuple(note for note in notes if type(note) is int)
        if len(sizes) != (1 if hint is Vector else 2) or min(sizes) < 1:
            example = f"Annotated[{_word(hint)}, Variable(...)]"
            raise Misdeclared(place, f"a {hint.__name__} needs its size; write {example}")
        return sizes, float
    if get_origin(hint) is tuple:
        elements = [*dict.fromkeys(get_args(hint))]
        if len(elements) != 1 or get_args(hint) == ((),):
            raise Misdeclared(place, "a tuple has elements of one type, as in tuple[float, float]")
        below, number = _shape(elements[0], (), place)
        return (len(get_args(hint)), *below), number
    if hint in _TYPES or (isinstance(hint, type) and issubclass(hint, IntEnum)):
        return (), hint
    kinds = "float, int, bool, an IntEnum, a tuple of them, Vector, Matrix or a NamedTuple"
    raise Misdeclared(place, f"{_word(hint)} is no type of a port; use {kinds}")


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
        raise Misdeclared(place, f"starts with {start!r:.40}, which has not {shape[0]} elements")
    else:
        for part in start:
            yield from _flat(part, shape[1:], place)


def _check(said: Variable, causality: str, place: tuple[str, ...]) -> None:
    """Hold what a field says against what can be said of its ports."""
    for name, of in _ONLY.items():
        if getattr(said, name) not in (None, False) and causality != of:
            raise Misdeclared(place, f"{name} is for {of}s")
    if causality == "output" and (said.minimum, said.maximum) != (None, None):
        raise Misdeclared(place, "minimum and maximum are for inputs and parameters")
    if isinstance(said.feedthrough, str):
        raise Misdeclared(place, f"feedthrough is a tuple; write ({said.feedthrough!r},)")


def _port(name: str, causality: str, said: Variable, part: _Part, place: tuple[str, ...]) -> Port:
    kind, start, choices, bounds = _meant(part, causality, place)
    if kind != "Real" and said.unit != "1":
        raise Misdeclared(place, f"only a float has a unit, not {_word(part.type)}")
    variability = "tunable" if said.tunable else "fixed"
    if causality != "parameter":
        variability = "continuous" if kind == "Real" else "discrete"
    port = Port(
        name,
        causality,
        variability,
        kind,
        ": ".join(filter(None, (said.description, part.label))),
        said.unit if kind == "Real" else None,
        start,
        *(bounds or (said.minimum, said.maximum)),
        choices,
    )
    try:
        port.checked(start)
    except Refusal as refusal:
        raise Misdeclared(place, f"starts with {refusal}") from None
    return replace(port, start=None) if causality == "output" else port


def _meant(part: _Part, causality: str, place: tuple[str, ...]) -> tuple[str, Any, Any, Any]:
    """FMI's type of a number, its start value, its choices, and bounds that follow from them."""
    number, start = part.type, part.start
    if number in _TYPES:
        kind, zero = _TYPES[number]
        start = zero if start is None else start
        is_whole = kind == "Real" and type(start) is int
        return kind, float(start) if is_whole else start, {}, None
    members = list(number)
    start = members[0] if start is None else start
    if not isinstance(start, number):
        raise Misdeclared(place, f"starts with {start!r:.40}, which is no {number.__name__}")
    if causality == "parameter":
        return "String", start.name, {one.name: one for one in members}, None
    bounds = (int(min(members)), int(max(members))) if causality == "input" else None
    return "Integer", int(start), {}, bounds
