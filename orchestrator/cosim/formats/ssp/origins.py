"""Where values come from: the connection that ends at each node, and what parameter sets give."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TypeAlias
from xml.etree.ElementTree import Element

from orchestrator.cosim.formats.ssp.archive import Archive
from orchestrator.cosim.formats.ssp.hierarchy import (
    GIVES,
    TAKES,
    Bus,
    Connector,
    Definitions,
    Group,
    Items,
    Leaf,
    Node,
    definitions_of,
    shape_of,
)
from orchestrator.cosim.system.units import Linear, Mapped, Transformation, Unit, combine
from orchestrator.cosim.system.values import family_of
from orchestrator.cosim.system.variables import element_names
from orchestrator.machine.errors import InputError, did_you_mean, listed
from orchestrator.machine.texts import BOOLEANS, finite, whole

_TABLES = (
    "BooleanMappingTransformation", "IntegerMappingTransformation",
    "EnumerationMappingTransformation",
)  # fmt: skip

#: The types of files that are known.
_VALUES, _MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"


def _transformation(content: Element, source: Items, target: Items) -> Transformation | None:
    """The transformation in a connection or an entry of a mapping; None: there is none.

    Args:
        content: element of the connection or entry.
        source, target: values of the enumerations at its ends, if there are any.

    Raises:
        ValueError: it has a mistake.

    """
    linear = content.find("LinearTransformation")
    if linear is not None:
        factor, offset = linear.get("factor", "1"), linear.get("offset", "0")
        return Linear(finite(factor, "factor"), finite(offset, "offset"))
    for name in _TABLES:
        table = content.find(name)
        if table is not None:
            entries = table.findall("MapEntry")
            pairs = [
                (_value(name, entry, "source", source), _value(name, entry, "target", target))
                for entry in entries
            ]
            if len(dict(pairs)) < len(pairs):
                raise ValueError("a mapping has two entries for one source")
            return Mapped(tuple(pairs))
    return None


def _value(table: str, entry: Element, end: str, items: Items) -> int:
    """One value of a table, as the number that FMI has for it."""
    text = entry.get(end, "")
    if table.startswith("Boolean"):
        if text not in BOOLEANS:
            raise ValueError(f"{end} {text!r} of a mapping is neither true nor false")
        return int(BOOLEANS[text])
    if table.startswith("Enumeration"):
        if text not in items:
            raise ValueError(f"{end} {text!r} of a mapping is not in its enumeration")
        return int(items[text])
    return whole(text, f"{end} of a mapping:")


def _converts_units(content: Element) -> bool:
    """Whether a connection or an entry of a mapping has units converted."""
    return not BOOLEANS.get(content.get("suppressUnitConversion", "false"), False)


@dataclass(frozen=True)
class Segment:
    """One connection of a file, which ends in a node.

    Attributes:
        source: where its value comes from.
        unit: of its target; None: it is the one that arrives.
        stated: transformation of the value, after its unit has been converted.
        converts: whether its unit is converted.

    """

    source: Node
    unit: Unit | None
    stated: Transformation | None
    converts: bool

    def carry(
        self, archive: Archive, whole: Transformation | None, unit: Unit | None
    ) -> tuple[Transformation | None, Unit | None]:
        """What has happened to a value at the segment's end, and the unit that it has there.

        Args:
            archive: whose connection it is.
            whole: what has happened to it before.
            unit: in which it comes.

        Raises:
            InputError: units do not fit, or transformations cannot follow each other.

        """
        step = self.stated
        if self.converts:
            step = combine(archive.conversion(unit, self.unit), step)
            # What a transformation makes of a value is in the target's unit, or unknown.
            unit = self.unit or (unit if self.stated is None else None)
        else:
            # Said even where it changes nothing: the units at its ends may differ.
            step, unit = step or Linear(), self.unit
        return combine(whole, step), unit


def segments_of(archive: Archive, top: Group) -> dict[Node, Segment]:
    """The connections of a system and of those in it, by the nodes in which they end.

    What is wrong with one becomes a problem of the archive.
    """
    found: dict[Node, Segment] = {}
    for group in top.elements():
        if isinstance(group, Group):
            for connection in group.content.findall("Connections/Connection"):
                try:
                    _add(found, group, connection)
                except InputError as error:
                    archive.problem(error)
    return found


def _add(found: dict[Node, Segment], group: Group, connection: Element) -> None:
    start, end = (_End.of(group, connection, which) for which in ("start", "end"))
    named = f"{start.node} -> {end.node}"
    if (start.takes and end.takes) or (start.gives and end.gives):
        both = "take a value" if start.takes else "give one"
        raise InputError(f"{named}: cannot be connected, as both {both}")
    # The standard lets a connection be written from either end.
    source, target = (end, start) if start.takes or end.gives else (start, end)
    if source.indices != target.indices:
        raise InputError(f"{named}: arrays of different dimensions cannot be connected")
    try:
        stated = _transformation(connection, source.connector.items, target.connector.items)
    except ValueError as error:
        raise InputError(f"{named}: {error}") from None
    unit, converts = target.connector.unit, _converts_units(connection)
    for index in source.indices:
        begin, stop = source.element(index), target.element(index)
        if (before := found.get(stop)) is not None:
            raise InputError(
                f"{stop} is fed by {before.source} and by {begin}; an input takes one connection"
            )
        found[stop] = Segment(begin, unit, stated, converts)


@dataclass(frozen=True)
class _End:
    """An end of a connection, as the system sees it in which the connection is.

    Attributes:
        node: where it is.
        connector: what is known of it.
        gives, takes: which way its value goes; neither: both are possible.

    """

    node: Node
    connector: Connector
    gives: bool
    takes: bool

    @property
    def indices(self) -> list[str]:
        """What follows its name in the names of its elements; of a scalar, nothing."""
        return _indices(self.node, self.connector)

    def element(self, index: str) -> Node:
        """One of its elements."""
        return Node(self.node.way, self.node.port + index)

    @classmethod
    def of(cls, group: Group, connection: Element, which: str) -> _End:
        """The start or the end of a connection."""
        # Some writers leave it empty where it is the system itself.
        name, port = connection.get(f"{which}Element") or None, connection.get(f"{which}Connector")
        if not port:
            raise InputError(f"a <{connection.tag}> without {which}Connector")
        if indices := connection.get(f"{which}Indices"):
            port = f"{port}[{','.join(indices.split())}]"
        element: Leaf | Bus | Group | None = group if name is None else group.members.get(name)
        if element is None:
            raise InputError(
                f"a connection to {Node((*group.way, name or ''), port)}: "
                f"there is no element {name!r}{did_you_mean(name or '', group.members)}"
            )
        connector = element.connector(port)
        if connector is None:
            if isinstance(element, Leaf) and element.component is not None:
                element.component.variable(port)
            raise InputError(
                f"a connection to {Node(element.way, port)}, which does not exist"
                f"{did_you_mean(port, element.connectors)}"
            )
        outwards, inwards = connector.causality in GIVES, connector.causality in TAKES
        # Seen from within, a system's inputs give and its outputs take.
        gives, takes = (inwards, outwards) if element is group else (outwards, inwards)
        return cls(Node(element.way, port), connector, gives, takes)


def _indices(node: Node, connector: Connector) -> list[str]:
    """What follows a name in the names of the elements of its array; of a scalar, nothing."""
    return [name.removeprefix(node.port) for name in connector.elements] or [""]


@dataclass(frozen=True)
class Given:
    """A value of a parameter set, and what happens to it on its way to a node.

    Attributes:
        text: the value.
        unit: of the value; None: the node's.
        items: values of its enumeration; empty: the variable's count.
        entry: of the mapping that it came through.

    """

    text: str
    unit: Unit | None = None
    items: Items = field(default_factory=dict)
    entry: Element | None = None

    def transformation(self, archive: Archive, target: Connector) -> Transformation | None:
        """What makes of it the value of a node.

        Raises:
            ValueError: units do not fit, or the mapping has a mistake.

        """
        stated = None
        if self.entry is not None:
            stated = _transformation(self.entry, self.items, target.items)
            if not _converts_units(self.entry):
                return stated
        return combine(archive.conversion(self.unit, target.unit), stated)


#: What is given to nodes, and what is known of each of these.
Values: TypeAlias = dict[Node, tuple[Given, Connector]]

#: The values of a parameter's elements, by what follows its name in theirs; of a scalar, nothing.
_Elements: TypeAlias = dict[str, Given]


class Bindings:
    """The values of all parameter sets of a description."""

    def __init__(self, archive: Archive, definitions: Definitions) -> None:
        """Take the archive, and what its description defines."""
        self._archive, self._definitions = archive, definitions

    def values(self, top: Group) -> Values:
        """What is given to which node.

        Of several values the one of the outer system counts, then the one of the later set.
        """
        given: Values = {}
        for element in _inside_out(top):
            for binding in element.content.findall("ParameterBindings/ParameterBinding"):
                try:
                    self._apply(binding, element, given)
                except InputError as error:
                    self._archive.problem(error)
        return given

    def _apply(self, binding: Element, element: Leaf | Bus | Group, given: Values) -> None:
        where = ".".join(element.way) or "the system"
        values = self._content(binding, element, where, "ParameterValues/ParameterSet", _VALUES)
        if values is None:
            return
        prefix = binding.get("prefix", "")
        parameters = {
            prefix + name: value for name, value in self._parameters(values, where).items()
        }
        mapping = binding.find("ParameterMapping")
        if mapping is not None:
            entries = self._content(mapping, element, where, "ParameterMapping", _MAPPING)
            parameters = {} if entries is None else self._mapped(parameters, entries, where)
        unknown = []
        for name, values_of in parameters.items():
            for node, connector in element.named(name):
                if _indices(node, connector) != list(values_of):
                    raise InputError(
                        f"{node}: {len(values_of)} values for {len(connector.elements) or 1}: "
                        "the dimensions must be the same"
                    )
            for index, value in values_of.items():
                reached = {node: (value, of) for node, of in element.named(name + index)}
                given.update(reached)
                if not reached:
                    unknown.append(name + index)
        if unknown and not (isinstance(element, Leaf) and element.component is None):
            self._archive.note(
                f"{where} has nothing named {listed(unknown)}; values for it have no effect"
            )

    def _content(
        self, element: Element, owner: Leaf | Bus | Group, where: str, inline: str, media_type: str
    ) -> Element | None:
        """What an element holds, itself or in the file that it names."""
        stated = element.get("type", media_type)
        if stated != media_type:
            self._archive.problem(f"{where}: parameters of type {stated!r} are not supported")
            return None
        source = element.get("source")
        if source is None:
            found = element.find(inline)
            if found is None:
                self._archive.note(f"{where}: a <{element.tag}> without content")
            return found
        base = None
        if element.get("sourceBase", "SSD") != "SSD":
            if not isinstance(owner, Leaf) or owner.component is None:
                named = ".".join(owner.way)
                raise InputError(f"a file of {named!r}, which is not a component with an FMU")
            base = owner.component.folder
        file = self._archive.file(source, where, base)
        return None if file is None else self._archive.read(file)

    def _mapped(
        self, parameters: dict[str, _Elements], mapping: Element, where: str
    ) -> dict[str, _Elements]:
        """Those parameters that a mapping names, under their new names."""
        found = {}
        for entry in mapping.findall("MappingEntry"):
            source, target = (
                self._archive.required(entry, end, where) for end in ("source", "target")
            )
            if source in parameters:
                values = parameters[source].items()
                found[target] = {index: replace(given, entry=entry) for index, given in values}
        return found

    def _parameters(self, values: Element, where: str) -> dict[str, _Elements]:
        """The values of a parameter set by their names."""
        known = definitions_of(self._archive, values, self._definitions)
        found: dict[str, _Elements] = {}
        for parameter in values.findall("Parameters/Parameter"):
            name = self._archive.required(parameter, "name", where)
            value = next(iter(parameter), None)
            try:
                shape = shape_of(parameter)
            except ValueError as error:
                self._archive.problem(f"{where}: {name} {error}")
                continue
            texts = [] if value is None else _texts(value, bool(shape))
            indices = list(element_names("", shape))
            if value is None or not texts:
                self._archive.problem(f"{where}: {name}: a parameter without a value")
                continue
            if len(texts) != len(indices):
                self._archive.problem(f"{where}: {name}: {len(texts)} values for {len(indices)}")
                continue
            if name in found:
                self._archive.note(f"{where}: {name} appears twice in a parameter set")
            of = known.unit(value), known.items(value)
            found[name] = {i: Given(text, *of) for i, text in zip(indices, texts, strict=True)}
        return found


def _texts(value: Element, is_array: bool) -> list[str]:
    """The values of a parameter, in the order of an array's elements."""
    if is_array and family_of(value.tag) in ("Real", "Integer", "Boolean"):
        return value.get("value", "").split()
    several = value.findall("Value")
    return [text for one in several or [value] if (text := one.get("value")) is not None]


def _inside_out(group: Group) -> Iterator[Leaf | Bus | Group]:
    """All elements of a system, each after those in it."""
    for element in group.members.values():
        if isinstance(element, Group):
            yield from _inside_out(element)
        else:
            yield element
    yield group
