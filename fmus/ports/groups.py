"""Flat values of ports and the groups that equations take and give, each made from the other."""

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
    """Where each group of neighbouring ports lies among their values."""
    found: dict[str, slice] = {}
    start = 0
    for group, members in groupby(ports, lambda port: group_name(port.name)):
        if group in found:
            raise TypeError(f"the ports of {group} are not neighbours")
        found[group] = slice(start, start + len(list(members)))
        start = found[group].stop
    return found


def hints_of(owner: Any) -> dict[str, Any]:
    """Types of the fields of a class, or of the arguments of a function, with their sizes."""
    return get_type_hints(owner, include_extras=True)


def parts_of(hint: Any) -> list[Any] | None:
    """The types of the elements of a tuple, a vector, a matrix or a NamedTuple; None: a number."""
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
    """Whether a type is a NamedTuple."""
    return is_class(hint, tuple) and hasattr(hint, "_fields")


def is_class(hint: Any, base: type) -> bool:
    """Whether a type is a class, and no `tuple[float]`, that is made from a base."""
    return isinstance(hint, type) and get_origin(hint) is None and issubclass(hint, base)


def split(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """A type without what is noted beside it, and that."""
    if get_origin(hint) is Annotated:
        inner, *notes = get_args(hint)
        return inner, tuple(notes)
    return hint, ()


def sizes_in(notes: Iterable[Any]) -> tuple[int, ...]:
    """The sizes of a vector or a matrix, of what is noted beside its type."""
    return tuple(note for note in notes if type(note) is int)


def class_of(hint: Any) -> Any:
    """A type without what is noted beside it."""
    return split(hint)[0]


def count_values(hint: Any) -> int:
    """How many numbers a type holds."""
    return sum(1 for _ in scalars_of(hint))


def scalars_of(hint: Any) -> Iterator[Any]:
    """The types of the numbers that a type holds, in their order."""
    parts = parts_of(hint)
    if parts is None:
        yield class_of(hint)
        return
    for part in parts:
        yield from scalars_of(part)


def is_whole(hint: Any) -> bool:
    """Whether a type is one of integers, or an enumeration of them."""
    return hint is int or is_class(hint, IntEnum)


def form(hint: Any) -> Any:
    """A type that equals all others whose values are alike: with its sizes, without other notes."""
    if get_origin(hint) is Annotated:
        inner, notes = split(hint)
        sizes = sizes_in(notes)
        return Annotated[(inner, *sizes)] if inner in (Vector, Matrix) and sizes else form(inner)
    if get_origin(hint) is tuple:
        return GenericAlias(tuple, tuple(map(form, get_args(hint))))
    return type(None) if hint is None else hint


def word(hint: Any) -> str:
    """A type as it is written."""
    if hint is type(None):
        return "None"
    if get_origin(hint) is Annotated:
        inner, *sizes = get_args(hint)
        return f"Annotated[{word(inner)}, {', '.join(map(str, sizes))}]"
    if get_origin(hint) is tuple:
        return f"tuple[{', '.join(map(word, get_args(hint)))}]"
    return hint.__name__ if is_class(hint, object) else str(hint)


def check_type(hint: Any, *place: str, around: tuple[Any, ...] = ()) -> None:
    """Refuse a type that no group can have, or a part of it.

    Args:
        hint: the type.
        place: the names of the class and of the field that have it.
        around: classes that it is a part of.

    Raises:
        Misdeclared: it is none of the language of equations.

    """
    (kind, notes), where = split(hint), f"{'.'.join(place)} " if place else ""
    if kind in (Vector, Matrix):
        sizes = sizes_in(notes)
        if len(sizes) != (1 if kind is Vector else 2) or min(sizes) < 1:
            said = f"{kind.__name__}, {'3' if kind is Vector else '2, 3'}{', ...' if notes else ''}"
            why = f"is a {kind.__name__} without its size; write Annotated[{said}]"
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
    """The fields of a class and their types.

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
    """Ports in the order of their values, in which a host can pass all Reals in one call."""
    return sorted(ports, key=lambda port: port.type != "Real")


def unpacking(made: type[T], ports: Sequence[Port]) -> Callable[[Sequence[Value]], T]:
    """A function that makes groups from the values of ports, Reals first.

    Args:
        made: NamedTuple with a number or a tuple a group, in the order of the ports.
        ports: with one value each.

    """
    if not ports:
        nothing = made()
        return lambda values: nothing
    names = [f"x{i}" for i in range(len(ports))]
    ordered = [name for name, _ in sorted(zip(names, ports), key=lambda one: one[1].type != "Real")]
    scope = {**SCOPE}
    result = gathered(made, iter(names), scope)
    return compiled("values", f"({', '.join(ordered)},) = values\n return {result}", scope)


def gathered(hint: Any, names: Iterator[str], scope: dict[str, Any]) -> str:
    """The text of a value of a type, from the names of its numbers; the scope gets its classes."""
    parts, kind = parts_of(hint), class_of(hint)
    if parts is None:
        name = next(names)
        if not is_class(kind, IntEnum):
            return name
        members = f"members_{kind.__name__}"
        scope[members] = {int(member): member for member in kind}
        # What is restored as an output need not be one.
        return f"{members}.get({name}, {name})"
    text = f"({''.join(f'{gathered(part, names, scope)}, ' for part in parts)})"
    if not is_class(kind, tuple):
        return text
    name = f"class_{kind.__name__}"
    scope[name] = kind
    return f"make({name}, {text})"


def packed(given: Any, groups: Mapping[str, str]) -> str:
    """The text of a list of the values of ports, Reals first, from those of groups.

    It raises OverflowError for an integer that FMI has no room for.

    Args:
        given: NamedTuple with a number or a tuple a group, in the order of the ports.
        groups: the texts of its fields.

    """
    hints = hints_of(given)
    texts = [pair for name, text in groups.items() for pair in scattered(hints[name], text)]
    return f"[{', '.join(text for text, _ in sorted(texts, key=lambda it: it[1] is not float))}]"


def scattered(hint: Any, text: str) -> Iterator[tuple[str, Any]]:
    """The texts of the numbers in something, one or several alike each, and their type."""
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
    """An integer, or a member of an enumeration, as an integer of 32 bits.

    Raises:
        OverflowError: it has more.

    """
    if not is_int32(value):
        raise OverflowError("an integer exceeds 32 bits")
    return int(value)


#: What compiled functions may use.
SCOPE: Mapping[str, Any] = {"make": tuple.__new__, "whole": whole}


def compiled(argument: str, body: str, scope: dict[str, Any]) -> Callable[[Any], Any]:
    """A function from its text.

    It runs once a step in each component, and a loop over the groups costs several times the
    same thing written out.
    """
    exec(f"def function({argument}):\n {body}", scope)
    function: Callable[[Any], Any] = scope["function"]
    return function


class ParameterSet(Generic[T]):
    """Ports of the parameters that make one parameter set of the equations, number by number."""

    def __init__(self, made: type[T], ports: Sequence[Port]) -> None:
        """Declare the set.

        Args:
            made: NamedTuple of the equations.
            ports: for each number in it.

        """
        self._made = made
        self.ports = tuple(ports)

    @property
    def paths(self) -> dict[str, tuple[str | int, ...]]:
        """Where each parameter lies in the set, by its name: fields, and places in tuples."""
        return dict(zip((port.name for port in self.ports), _places(self._made)))

    def of(self, values: Mapping[str, Value]) -> T:
        """The parameter set with these values of its ports, by name."""
        made: T = filled(self._made, iter([port.meaning(values[port.name]) for port in self.ports]))
        return made


def filled(hint: Any, values: Iterator[Any]) -> Any:
    """A value of a type from its numbers."""
    parts = parts_of(hint)
    if parts is None:
        return next(values)
    elements = tuple(filled(part, values) for part in parts)
    made = class_of(hint)
    return tuple.__new__(made, elements) if is_class(made, tuple) else elements


def _places(hint: Any) -> Iterator[tuple[str | int, ...]]:
    """Where the numbers of a type lie in it."""
    parts, kind = parts_of(hint), class_of(hint)
    if parts is None:
        yield ()
        return
    for step, part in zip(kind._fields if is_record(kind) else count(), parts):
        yield from ((step, *rest) for rest in _places(part))
