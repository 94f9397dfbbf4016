"""Flat values of ports and the groups that equations take and give, each made from the other.

What a component's types say of its groups is held against its ports when its class is made: a
group that is missing, too long, or elsewhere than its ports is a TypeError there, and not a
number in the wrong place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import (
    Annotated,
    Any,
    Generic,
    NamedTuple,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from auv_fmu.arrays import Matrix, Vector
from fmus.ports.port import Port, Value
from fmus.ports.quantities import group_name

T = TypeVar("T")


class Nothing(NamedTuple):
    """State of a component without memory; inputs of one without inputs."""


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
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        sizes = [note for note in notes if type(note) is int]
        if hint is Vector:
            return [float] * sizes[0]
        if hint is Matrix:
            return [Annotated[Vector, sizes[1]]] * sizes[0]
    if isinstance(hint, type) and issubclass(hint, tuple) and hasattr(hint, "_fields"):
        return list(hints_of(hint).values())
    arguments = get_args(hint)
    return [*arguments] if get_origin(hint) is tuple and Ellipsis not in arguments else None


def class_of(hint: Any) -> Any:
    """The class of a type, without its sizes."""
    plain = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    return get_origin(plain) or plain


def count_values(hint: Any) -> int:
    """How many numbers a type holds."""
    parts = parts_of(hint)
    return 1 if parts is None else sum(map(count_values, parts))


def _sizes(fields: type) -> dict[str, int]:
    """The fields of a NamedTuple or TypedDict and how many values each holds."""
    return {name: count_values(hint) for name, hint in hints_of(fields).items()}


def _hold(fields: type, ports: Sequence[Port], groups: Mapping[str, str]) -> dict[str, slice]:
    """The slices of the ports, if they are the fields'."""
    places = slices(ports)
    said = [(groups.get(name, name), size) for name, size in _sizes(fields).items()]
    declared = [(group, place.stop - place.start) for group, place in places.items()]
    if said != declared:
        raise TypeError(f"{fields.__qualname__} has the groups {said}, its ports are {declared}")
    return places


def unpacking(
    made: type[T], ports: Sequence[Port], groups: Mapping[str, str]
) -> Callable[[Sequence[Value]], T]:
    """A function that makes groups from the values of ports.

    Args:
        made: NamedTuple or TypedDict with a number or a tuple a group, in the order of the ports.
        ports: with one value each.
        groups: of fields that bear another name than their group.

    Raises:
        TypeError: `made` has other groups than the ports.

    """
    if not _hold(made, ports, groups):
        nothing = made()
        return lambda values: nothing
    names = iter(f"x{i}" for i in range(len(ports)))
    fields = {name: gathered(hint, names) for name, hint in hints_of(made).items()}
    arguments = ", ".join(f"x{i}" for i in range(len(ports)))
    if issubclass(made, tuple):
        result = f"make(made, ({''.join(f'{text}, ' for text in fields.values())}))"
    else:
        result = f"{{{', '.join(f'{name!r}: {text}' for name, text in fields.items())}}}"
    return _compiled(f"({arguments},) = values\n return {result}", "values", made)


def gathered(hint: Any, names: Iterator[str]) -> str:
    """The text of a value of a type, from the names of its numbers."""
    parts = parts_of(hint)
    if parts is None:
        return next(names)
    text = f"({''.join(f'{gathered(part, names)}, ' for part in parts)})"
    kind = {Vector: "Vector", Matrix: "Matrix"}.get(class_of(hint))
    return f"make({kind}, {text})" if kind else text


def packing(given: type[T], ports: Sequence[Port]) -> Callable[[T], list[Value]]:
    """A function that makes the values of ports from groups.

    Args:
        given: TypedDict or NamedTuple with a number or a tuple a group, in the order of the ports.
        ports: to have one value each.

    Raises:
        TypeError: `given` has other groups than the ports.

    """
    _hold(given, ports, {})
    is_tuple = issubclass(given, tuple)
    texts = [
        _scattered(hint, f"groups.{name}" if is_tuple else f"groups[{name!r}]")
        for name, hint in hints_of(given).items()
    ]
    return _compiled(f"return [{', '.join(texts)}]", "groups", given)


def _scattered(hint: Any, text: str) -> str:
    """The text of the numbers in something."""
    parts = parts_of(hint)
    if parts is None:
        return text
    if all(parts_of(part) is None for part in parts):
        return f"*{text}"
    return ", ".join(_scattered(part, f"{text}[{i}]") for i, part in enumerate(parts))


#: What compiled functions may use.
SCOPE: Mapping[str, Any] = {"make": tuple.__new__, "Vector": Vector, "Matrix": Matrix}


def _compiled(body: str, argument: str, made: type) -> Callable[..., Any]:
    """A function from its text.

    It runs once a step in each component, and a loop over the groups costs several times the
    same thing written out.
    """
    scope: dict[str, Any] = {"made": made, **SCOPE}
    exec(f"def function({argument}):\n {body}", scope)
    function: Callable[..., Any] = scope["function"]
    return function


Field = Union[Port, tuple[Port, ...], "ParameterSet[Any]"]


class ParameterSet(Generic[T]):
    """Ports of the parameters that make one parameter set of the equations, field by field."""

    def __init__(self, made: Callable[..., T], **fields: Field) -> None:
        """Declare the set.

        Args:
            made: NamedTuple of the equations.
            fields: for each field a port, the ports of a tuple, vector or matrix, or the set of a
                nested NamedTuple, in the order that the ports shall have.

        Raises:
            TypeError: the fields are not `made`'s, or not of their sizes.

        """
        sizes = _sizes(made)  # type: ignore[arg-type]
        declared = {
            name: 1
            if isinstance(field, Port)
            else len(field if isinstance(field, tuple) else field.ports)
            for name, field in fields.items()
        }
        if declared != sizes:
            raise TypeError(f"{made} has the fields {sizes}, its parameters are {declared}")
        self._made = made
        self._hints = hints_of(made)
        self._fields = fields

    @property
    def ports(self) -> tuple[Port, ...]:
        """All parameters, in the order of their declaration."""
        return tuple(port for port, _ in self._leaves())

    def before(self, *later: Port) -> tuple[Port, ...]:
        """The parameters except some that have come later: these stand at the end of all ports.

        So the value references of the others are what they were.
        """
        return tuple(port for port in self.ports if port not in later)

    @property
    def paths(self) -> dict[str, tuple[str | int, ...]]:
        """Where each parameter lies in the set, by its name: fields, and places in tuples."""
        return {port.name: path for port, path in self._leaves()}

    def _leaves(self) -> Iterator[tuple[Port, tuple[str | int, ...]]]:
        for name, field in self._fields.items():
            if isinstance(field, Port):
                yield field, (name,)
            elif isinstance(field, tuple):
                places: Any = _places(self._hints[name])
                yield from ((port, (name, *at)) for port, at in zip(field, places))
            else:
                yield from ((port, (name, *path)) for port, path in field._leaves())

    def of(self, values: Mapping[str, Value]) -> T:
        """The parameter set with these values of its ports, by name."""
        hints = self._hints
        return self._made(
            **{name: _taken(field, hints[name], values) for name, field in self._fields.items()}
        )


def _taken(field: Field, hint: Any, values: Mapping[str, Value]) -> object:
    if isinstance(field, ParameterSet):
        return field.of(values)
    if isinstance(field, Port):
        return field.meaning(values[field.name])
    return filled(hint, iter([values[port.name] for port in field]))


def filled(hint: Any, values: Iterator[Any]) -> Any:
    """A value of a type from its numbers."""
    parts = parts_of(hint)
    if parts is None:
        return next(values)
    elements = tuple(filled(part, values) for part in parts)
    made = class_of(hint)
    return elements if made is tuple else tuple.__new__(made, elements)


def _places(hint: Any) -> Iterator[tuple[int, ...]]:
    """Where the numbers of a type lie in it."""
    parts = parts_of(hint)
    if parts is None:
        yield ()
        return
    for i, part in enumerate(parts):
        yield from ((i, *rest) for rest in _places(part))
