"""Conversion between flat values of ports and the groups of the equations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import IntEnum
from functools import cache
from itertools import count, groupby
from types import GenericAlias
from typing import (
    Annotated,
    Any,
    Generic,
    NamedTuple,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.quantities import group_name
from fmus.ports.port import Misdeclared, Port, Value, is_int32

T = TypeVar("T")


class Nothing(NamedTuple):
    """State of a component without memory; inputs or parameters of one without any."""


def slices(ports: Sequence[Port]) -> dict[str, slice]:
    """Return the slice of each group of neighbouring ports among their values."""
    slices: dict[str, slice] = {}
    start = 0
    for group, members in groupby(ports, lambda port: group_name(port.name)):
        if group in slices:
            raise TypeError(f"the ports of {group} are not neighbours")
        slices[group] = slice(start, start + len(list(members)))
        start = slices[group].stop
    return slices


def hints_of(owner: Any) -> dict[str, Any]:
    """Return the types of a class's fields, or of a function's arguments, with their sizes."""
    return get_type_hints(owner, include_extras=True)


def parts_of(hint: Any) -> list[Any] | None:
    """Return the types of a group's elements; None if the type is a number."""
    hint, notes = split(hint)
    sizes = sizes_in(notes)
    if hint is Vector and sizes:
        return [float] * sizes[0]
    if hint is Matrix and sizes:
        return [Annotated[Vector, sizes[1]]] * sizes[0]
    if is_record(hint):
        return _parts_of_record(hint)
    arguments = get_args(hint)
    return [*arguments] if get_origin(hint) is tuple and Ellipsis not in arguments else None


@cache
def _parts_of_record(made: Any) -> list[Any]:
    return [*hints_of(made).values()]


def is_record(hint: Any) -> bool:
    """Return True for a NamedTuple."""
    return is_class(hint, tuple) and hasattr(hint, "_fields")


def is_class(hint: Any, base: type) -> bool:
    """Return True for a subclass of a base, but not for a generic such as `tuple[float]`."""
    return isinstance(hint, type) and get_origin(hint) is None and issubclass(hint, base)


def split(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """Split an annotated type into the type and its notes."""
    if get_origin(hint) is Annotated:
        inner, *notes = get_args(hint)
        return inner, tuple(notes)
    return hint, ()


def sizes_in(notes: Iterable[Any]) -> tuple[int, ...]:
    """Return the sizes of a vector or a matrix, which are among the notes of its type."""
    return tuple(note for note in notes if type(note) is int)


def class_of(hint: Any) -> Any:
    """Return a type without its notes."""
    return split(hint)[0]


def count_values(hint: Any) -> int:
    """Return the number of numbers in a type."""
    return sum(1 for _ in scalars_of(hint))


def scalars_of(hint: Any) -> Iterator[Any]:
    """Yield the types of the numbers in a type, in order."""
    parts = parts_of(hint)
    if parts is None:
        yield class_of(hint)
        return
    for part in parts:
        yield from scalars_of(part)


def flat(value: Any) -> Iterator[Any]:
    """Yield the numbers in nested tuples or lists, in order."""
    if isinstance(value, (tuple, list)):
        for part in value:
            yield from flat(part)
    else:
        yield value


def is_whole(hint: Any) -> bool:
    """Return True for an integer or an enumeration."""
    return hint is int or is_class(hint, IntEnum)


def form(hint: Any) -> Any:
    """Return a type with its sizes but without other notes, for comparison."""
    if get_origin(hint) is Annotated:
        inner, notes = split(hint)
        sizes = sizes_in(notes)
        return Annotated[(inner, *sizes)] if inner in (Vector, Matrix) and sizes else form(inner)
    if get_origin(hint) is tuple:
        return GenericAlias(tuple, tuple(map(form, get_args(hint))))
    return type(None) if hint is None else hint


def word(hint: Any) -> str:
    """Return the text of a type."""
    if hint is type(None):
        return "None"
    if get_origin(hint) is Annotated:
        inner, *sizes = get_args(hint)
        return f"Annotated[{word(inner)}, {', '.join(map(str, sizes))}]"
    if get_origin(hint) is tuple:
        return f"tuple[{', '.join(map(word, get_args(hint)))}]"
    return hint.__name__ if is_class(hint, object) else str(hint)


def check_type(hint: Any, *place: str, around: tuple[Any, ...] = ()) -> None:
    """Refuse a type that is not in the language of equations, or has such a part.

    Raises:
        Misdeclared: it is not in the language.

    """
    (kind, notes), where = split(hint), f"{'.'.join(place)} " if place else ""
    if kind in (Vector, Matrix):
        sizes = sizes_in(notes)
        if len(sizes) != (1 if kind is Vector else 2) or min(sizes) < 1:
            example = (
                f"{kind.__name__}, {'3' if kind is Vector else '2, 3'}{', ...' if notes else ''}"
            )
            why = f"is a {kind.__name__} without its size; write Annotated[{example}]"
            raise Misdeclared(f"{where}{why}", *place)
    elif is_class(kind, IntEnum):
        for name, member in kind.__members__.items():
            if not (name.replace("-", "_").isidentifier() and is_int32(member)):
                why = f"has the member {name!r:.40} = {member:d}; write a name and 32 bits"
                raise Misdeclared(f"{kind.__name__} {why}", kind.__name__, name)
        if not kind.__members__:
            raise Misdeclared(f"{kind.__name__} has no members", kind.__name__)
    elif kind in around:
        raise Misdeclared(f"{where}is a {kind.__name__} within a {kind.__name__}", *place)
    elif is_record(kind):
        for name, part in fields_of(kind).items():
            check_type(part, kind.__name__, name, around=(*around, kind))
    elif get_origin(kind) is tuple and Ellipsis not in get_args(kind):
        for part in parts_of(kind) or ():
            check_type(part, *place, around=around)
    elif kind not in (float, int, bool):
        kinds = "float, int, bool, an IntEnum, a tuple of them, Vector, Matrix or a NamedTuple"
        raise Misdeclared(f"{where}has the type {word(form(hint))}; use {kinds}", *place)


def fields_of(made: Any) -> dict[str, Any]:
    """Return the fields of a class and their types.

    Raises:
        Misdeclared: a type is not known.

    """
    try:
        return hints_of(made)
    except NameError as error:
        missing = str(error).split("'")[1]
        named = [f for f, hint in made.__annotations__.items() if missing in str(hint)]
        place = (made.__name__, *named[:1])
        why = f"has a type that is not known: {error}"
        raise Misdeclared(f"{'.'.join(place)} {why}", *place) from None


def reals_first(ports: Sequence[Port]) -> list[Port]:
    """Sort ports Reals first, the order of values, so that one call can pass all Reals."""
    return sorted(ports, key=lambda port: port.type != "Real")


def unpacking(made: type[T], ports: Sequence[Port]) -> Callable[[Sequence[Value]], T]:
    """Compile a function that makes a NamedTuple of groups from values of ports, Reals first."""
    if not ports:
        nothing = made()
        return lambda values: nothing
    names = [f"x{i}" for i in range(len(ports))]
    ordered = [
        name for name, _ in sorted(zip(names, ports), key=lambda pair: pair[1].type != "Real")
    ]
    scope = {**SCOPE}
    result = gathered(made, iter(names), scope)
    return compiled("values", f"({', '.join(ordered)},) = values\n return {result}", scope)


def gathered(hint: Any, names: Iterator[str], scope: dict[str, Any]) -> str:
    """Return the expression of a value from the names of its numbers; add classes to the scope."""
    parts, kind = parts_of(hint), class_of(hint)
    if parts is None:
        name = next(names)
        if not is_class(kind, IntEnum):
            return name
        members = f"members_{kind.__name__}"
        scope[members] = {int(member): member for member in kind}
        # A restored output may be a number that is not a member.
        return f"{members}.get({name}, {name})"
    text = f"({''.join(f'{gathered(part, names, scope)}, ' for part in parts)})"
    if not is_class(kind, tuple):
        return text
    name = f"class_{kind.__name__}"
    scope[name] = kind
    return f"make({name}, {text})"


def packed(given: Any, groups: Mapping[str, str]) -> str:
    """Return the expression of a list of values of ports, Reals first, from groups.

    Its evaluation raises OverflowError for an integer of more than 32 bits.
    """
    hints = hints_of(given)
    texts = [pair for name, text in groups.items() for pair in scattered(hints[name], text)]
    return (
        f"[{', '.join(text for text, _ in sorted(texts, key=lambda pair: pair[1] is not float))}]"
    )


def scattered(hint: Any, text: str) -> Iterator[tuple[str, Any]]:
    """Yield expressions of the numbers in a value, each of one or several numbers of a type."""
    parts = parts_of(hint)
    if parts is None:
        scalar = class_of(hint)
        yield f"whole({text})" if is_whole(scalar) else text, scalar
    elif is_record(class_of(hint)):
        for name, part in hints_of(class_of(hint)).items():
            yield from scattered(part, f"{text}.{name}")
    elif parts and parts_of(parts[0]) is None and all(part is parts[0] for part in parts):
        scalar = class_of(parts[0])
        yield f"*map(whole, {text})" if is_whole(scalar) else f"*{text}", scalar
    else:
        for i, part in enumerate(parts):
            yield from scattered(part, f"{text}[{i}]")


def whole(value: int) -> int:
    """Convert an integer, or a member of an enumeration, to an integer of 32 bits.

    Raises:
        OverflowError: it does not fit.

    """
    if not is_int32(value):
        raise OverflowError("an integer exceeds 32 bits")
    return int(value)


#: Names that compiled functions may use.
SCOPE: Mapping[str, Any] = {"make": tuple.__new__, "whole": whole}


def compiled(argument: str, body: str, scope: dict[str, Any]) -> Callable[[Any], Any]:
    """Compile a function from its text.

    Such functions run once a step in each component, and a loop over the groups would take several
    times as long as written-out code.
    """
    exec(f"def function({argument}):\n {body}", scope)
    function: Callable[[Any], Any] = scope["function"]
    return function


class ParameterSet(Generic[T]):
    """Ports of a parameter set of the equations, one for each number in it."""

    def __init__(self, made: type[T], ports: Sequence[Port]) -> None:
        """Declare the set, a NamedTuple of the equations, with a port for each number in it."""
        self._made, self.ports = made, tuple(ports)
        self._unpack = unpacking(made, self.ports)

    @property
    def paths(self) -> dict[str, tuple[str | int, ...]]:
        """Path of each parameter in the set, by its name: fields, and indices in tuples."""
        return dict(zip((port.name for port in self.ports), _places(self._made)))

    def of(self, values: Mapping[str, Value]) -> T:
        """Make the parameter set from the values of its ports, by name."""
        return self._unpack([values[port.name] for port in reals_first(self.ports)])


def _places(hint: Any) -> Iterator[tuple[str | int, ...]]:
    """Yield the paths of the numbers in a type."""
    parts, kind = parts_of(hint), class_of(hint)
    if parts is None:
        yield ()
        return
    for step, part in zip(kind._fields if is_record(kind) else count(), parts):
        yield from ((step, *rest) for rest in _places(part))
