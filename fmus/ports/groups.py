"""Flat values of ports and the groups that equations take and give, each made from the other.

What a component's types say of its groups is held against its ports when its class is made: a
group that is missing, too long, or elsewhere than its ports is a TypeError there, and not a
number in the wrong place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, Generic, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

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


def _sizes(fields: type) -> dict[str, int]:
    """The fields of a NamedTuple or TypedDict and how many values each holds."""
    return {
        name: len(get_args(hint)) if get_origin(hint) is tuple else 1
        for name, hint in get_type_hints(fields).items()
    }


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
) -> Callable[[Sequence[float]], T]:
    """A function that makes groups from the values of ports.

    Args:
        made: NamedTuple with one tuple a group, in the order of the ports.
        ports: with one value each.
        groups: of fields that bear another name than their group.

    Raises:
        TypeError: `made` has other groups than the ports.

    """
    places = _hold(made, ports, groups).values()
    if not places:
        nothing = made()
        return lambda values: nothing
    names = [f"x{i}" for i in range(len(ports))]
    text = "".join(f"({', '.join(names[place])},), " for place in places)
    return _compiled(
        f"({', '.join(names)},) = values\n return make(made, ({text}))", "values", made
    )


def packing(given: type[T], ports: Sequence[Port]) -> Callable[[T], list[float]]:
    """A function that makes the values of ports from groups.

    Args:
        given: TypedDict with one tuple a group, in the order of the ports.
        ports: to have one value each.

    Raises:
        TypeError: `given` has other groups than the ports.

    """
    groups = ", ".join(f"*groups[{name!r}]" for name in _hold(given, ports, {}))
    return _compiled(f"return [{groups}]", "groups", given)


def _compiled(body: str, argument: str, made: type) -> Callable[..., Any]:
    """A function from its text.

    It runs once a step in each component, and a loop over the groups costs several times the
    same thing written out.
    """
    scope: dict[str, Any] = {"made": made, "make": tuple.__new__}
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
            fields: for each field a port, the ports of a tuple, or the set of a nested NamedTuple,
                in the order that the ports shall have.

        Raises:
            TypeError: the fields are not `made`'s, or not of their sizes.

        """
        sizes = _sizes(made)  # type: ignore[arg-type]
        declared = {
            name: len(field) if isinstance(field, tuple) else 1 for name, field in fields.items()
        }
        if declared != sizes:
            raise TypeError(f"{made} has the fields {sizes}, its parameters are {declared}")
        self._made = made
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
                yield from ((port, (name, i)) for i, port in enumerate(field))
            else:
                yield from ((port, (name, *path)) for port, path in field._leaves())

    def of(self, values: Mapping[str, Value]) -> T:
        """The parameter set with these values of its ports, by name."""
        return self._made(**{name: _taken(field, values) for name, field in self._fields.items()})


def _taken(field: Field, values: Mapping[str, Value]) -> object:
    if isinstance(field, ParameterSet):
        return field.of(values)
    if isinstance(field, Port):
        return field.meaning(values[field.name])
    return tuple(values[port.name] for port in field)
