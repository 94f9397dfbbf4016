"""Read an SSP archive as a system, with the experiment that it states."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from math import prod
from pathlib import Path
from typing import TypeAlias
from urllib.parse import quote
from xml.etree.ElementTree import Element, SubElement

from orchestrator.cosim.component import Component, read_component
from orchestrator.cosim.connection import (
    BASE_UNITS,
    Connection,
    Linear,
    Mapped,
    PortName,
    Transformation,
    Unit,
    Units,
    combine,
    unit_of_port,
)
from orchestrator.cosim.formats.archive import LEFT_OPEN, ORDER, Archive
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import MOST_ELEMENTS, Value, element_names, family_of
from orchestrator.machine.errors import Findings, InputError, did_you_mean, listed, shortened
from orchestrator.machine.texts import BOOLEANS, finite, integer, real, whole

#: An enumeration's values by the names of its items.
Items: TypeAlias = Mapping[str, int]

#: The names of a system and of the systems around it, except the outermost.
Way: TypeAlias = tuple[str, ...]

#: Which way a value goes, by the kind of an element's connector, seen from the system around it.
GIVES = ("output", "calculatedParameter", "constant", "local", "independent")
TAKES = ("input", "parameter", "structuralParameter")

_FMU = "application/x-fmu-sharedlibrary"

#: What a connector may have besides its type.
_NO_TYPES = ("Dimension", "Clock", "ConnectorGeometry", "Annotations")


@dataclass(frozen=True)
class Definitions:
    """Units and enumerations by their names."""

    units: Units = field(default_factory=dict)
    enumerations: Mapping[str, Items] = field(default_factory=dict)

    def unit(self, element: Element) -> Unit | None:
        """The unit that a type or a value is stated in; None: it states none."""
        name = element.get("unit")
        return self.units.get(name, Unit(name)) if name else None

    def items(self, element: Element) -> Items:
        """The items of the enumeration that a type or a value names; empty where there is none."""
        return self.enumerations.get(element.get("name", ""), {})


def definitions_of(archive: Archive, root: Element, outer: Definitions) -> Definitions:
    """The definitions of a file, which win over those around it."""
    units = dict(outer.units)
    for unit in root.findall("Units/Unit"):
        name, base = unit.get("name", ""), unit.find("BaseUnit")
        if base is not None:
            units[name] = Unit(
                name,
                tuple(archive.integer(base, of) for of in BASE_UNITS),
                archive.number(base, "factor", 1.0),
                archive.number(base, "offset", 0.0),
            )
    enumerations = {
        enumeration.get("name", ""): {
            item.get("name", ""): archive.integer(item, "value")
            for item in enumeration.findall("Item")
        }
        for enumeration in root.findall("Enumerations/Enumeration")
    }
    return Definitions(units, {**outer.enumerations, **enumerations})


def shape_of(content: Element) -> list[int]:
    """The lengths of an array as a connector or parameter states them; of a scalar, none.

    Raises:
        ValueError: it does not state them, or they are of no use.

    """
    try:
        shape = [integer(dimension.get("size", "")) for dimension in content.findall("Dimension")]
    except ValueError:
        raise ValueError("is an array of a size that is not stated") from None
    if any(length < 1 for length in shape) or prod(shape) > MOST_ELEMENTS:
        raise ValueError(f"is an array, which must have from 1 to {MOST_ELEMENTS:,} elements")
    return shape


@dataclass(frozen=True)
class Node:
    """A connector, or a variable of a component.

    Attributes:
        way: to the element.
        port: name of the connector.

    """

    way: Way
    port: str

    def __str__(self) -> str:
        """With dots, as parameters and columns are named."""
        return ".".join((*self.way, self.port))


@dataclass(frozen=True)
class Connector:
    """What a system says about one of its connectors, or an element's.

    Attributes:
        causality: of the connector; None: it does not say.
        type: what FMI 2.0 calls it or its like; None: it does not say.
        unit: None: it names none.
        items: of an enumeration.
        elements: the names of an array's elements, which are connectors as well.

    """

    causality: str | None = None
    type: str | None = None
    unit: Unit | None = None
    items: Items = field(default_factory=dict)
    elements: tuple[str, ...] = ()


@dataclass(frozen=True)
class Leaf:
    """A component.

    Attributes:
        way: to it.
        content: its element in the file.
        component: None: its FMU cannot be read, which has been said.
        connectors: that the file states.
        units: that the file defines.

    """

    way: Way
    content: Element
    component: Component | None
    connectors: Mapping[str, Connector]
    units: Units

    def connector(self, name: str) -> Connector | None:
        """A connector as the FMU has it; None: it has none of that name."""
        if self.component is None:
            return self.connectors.get(name, Connector())
        if name in self.component.arrays:
            elements = tuple(element.name for element in self.component.arrays[name])
            first = self.connector(elements[0])
            return None if first is None else replace(first, elements=elements)
        variable = self.component.variables.get(name)
        if variable is None:
            return None
        stated = self.connectors.get(name, Connector())
        unit = unit_of_port(self.component, name, self.units) or stated.unit
        items = {item: int(value) for item, value in variable.items.items()} or stated.items
        return Connector(variable.causality, variable.family, unit, items)

    def named(self, name: str) -> Iterator[tuple[Node, Connector]]:
        """The variable of a name.

        Raises:
            InputError: it is of a type that is not supported.

        """
        if self.component is None:
            return
        if name in self.component.unsupported:
            self.component.variable(name)
        if (connector := self.connector(name)) is not None:
            yield Node(self.way, name), connector


@dataclass(frozen=True)
class Bus:
    """A reference to a signal dictionary: all of its references have the same signals.

    Attributes:
        way: to the dictionary.
        content: the reference's element in the file.
        connectors: that the file states.

    """

    way: Way
    content: Element
    connectors: Mapping[str, Connector]

    def connector(self, name: str) -> Connector | None:
        """A connector, through which signals go in both directions."""
        stated = self.connectors.get(name)
        return None if stated is None else replace(stated, causality=None)

    def named(self, _: str) -> Iterator[tuple[Node, Connector]]:
        """Nothing in it has a value."""
        yield from ()


@dataclass(frozen=True)
class Group:
    """A system.

    Attributes:
        way: to it.
        content: its element in the file.
        connectors: its own.
        members: its elements by their names.

    """

    way: Way
    content: Element
    connectors: Mapping[str, Connector]
    members: Mapping[str, Leaf | Bus | Group]

    def connector(self, name: str) -> Connector | None:
        """One of its connectors; None: it has none of that name."""
        return self.connectors.get(name)

    def named(self, name: str) -> Iterator[tuple[Node, Connector]]:
        """All connectors and variables in it of a name, which several ways may spell."""
        if name in self.connectors:
            yield Node(self.way, name), self.connectors[name]
        for member, element in self.members.items():
            if name.startswith(f"{member}."):
                yield from element.named(name[len(member) + 1 :])

    def elements(self) -> Iterator[Leaf | Bus | Group]:
        """All elements in it in their order, each system before those in it; first itself."""
        yield self
        for element in self.members.values():
            if isinstance(element, Group):
                yield from element.elements()
            else:
                yield element


class Builder:
    """Reads the systems of a description."""

    def __init__(self, archive: Archive, definitions: Definitions) -> None:
        """Take the archive, and what its description defines."""
        self._archive, self._definitions = archive, definitions

    def group(
        self, content: Element, way: Way = (), buses: Mapping[str, Way] | None = None
    ) -> Group:
        """A system and all that is in it.

        Args:
            content: its element.
            way: to it.
            buses: ways to the signal dictionaries of the systems around it, by their names.

        """
        own = content.findall("SignalDictionaries/SignalDictionary")
        buses = {
            **(buses or {}),
            **{name: (*way, name, "") for d in own if (name := d.get("name"))},
        }
        members: dict[str, Leaf | Bus | Group] = {}
        for element in content.findall("Elements/*"):
            name = element.get("name", "")
            if not re.fullmatch(r"[^/\\]+", name):
                self._archive.problem(f"component {name!r}: write it without slashes")
            elif name in members:
                self._archive.problem(f"two components are named {'.'.join((*way, name))}")
            elif element.tag == "System":
                members[name] = self.group(element, (*way, name), buses)
            elif element.tag == "Component":
                members[name] = self._leaf(element, (*way, name))
            elif element.tag == "SignalDictionaryReference":
                bus = element.get("dictionary", "")
                if bus in buses:
                    members[name] = Bus(buses[bus], element, self._connectors(element))
                else:
                    self._archive.problem(f"{name}: there is no signal dictionary {bus!r}")
            else:
                self._archive.problem(f"{name}: a <{element.tag}> in a system is not supported")
        return Group(way, content, self._connectors(content), members)

    def _leaf(self, content: Element, way: Way) -> Leaf:
        component = self._component(content, ".".join(way))
        connectors = self._connectors(content)
        leaf = Leaf(way, content, component, connectors, self._definitions.units)
        if component is not None:
            self._compare(leaf)
        return leaf

    def _component(self, content: Element, name: str) -> Component | None:
        source, its_type = content.get("source"), content.get("type", _FMU)
        implementation = content.get("implementation", "any")
        if its_type != _FMU:
            why = f"a component of type {its_type!r} is not supported; only FMUs are"
        elif source is None:
            why = "a component without a source, which cannot be run"
        elif implementation not in ("any", "CoSimulation"):
            why = f"asks for {implementation}, which is not supported; only CoSimulation is"
        else:
            fmu = self._archive.file(source, name)
            try:
                findings = self._archive.findings
                return None if fmu is None else read_component(name, fmu, findings=findings)
            except InputError as error:
                why = str(error).removeprefix(f"{self._archive.folder}/")
        self._archive.problem(f"{name}: {why}")
        return None

    def _compare(self, leaf: Leaf) -> None:
        """Say where connectors are not what their FMU has."""
        absent = []
        elements = {name for stated in leaf.connectors.values() for name in stated.elements}
        known = leaf.component.unsupported if leaf.component else {}
        for name, stated in leaf.connectors.items():
            own = leaf.connector(name)
            if name in known or (own is not None and name in elements):
                continue
            if own is None:
                absent.append(name)
                continue
            for what, said, true in (
                ("kind", stated.causality, own.causality),
                ("type", stated.type, own.type),
                ("unit", stated.unit and stated.unit.name, own.unit and own.unit.name),
            ):
                if said and said != true:
                    self._archive.note(
                        f"{Node(leaf.way, name)}: its {what} is {said}, but {true} in its FMU"
                    )
        if absent:
            self._archive.note(
                f"{'.'.join(leaf.way)}: its FMU has no variables for the connectors "
                f"{listed(absent)}"
            )

    def _connectors(self, content: Element) -> dict[str, Connector]:
        found: dict[str, Connector] = {}
        for connector in content.findall("Connectors/Connector"):
            name, stated = connector.get("name", ""), self._connector(connector)
            elements: tuple[str, ...] = ()
            try:
                if shape := shape_of(connector):
                    elements = tuple(element_names(name, shape))
            except ValueError as error:
                # Of a component the FMU says it.
                if content.tag != "Component":
                    self._archive.problem(f"{content.get('name', '')}.{name} {error}")
            found |= {name: replace(stated, elements=elements), **dict.fromkeys(elements, stated)}
        return found

    def _connector(self, connector: Element) -> Connector:
        causality = connector.get("kind")
        for stated in connector:
            if stated.tag not in _NO_TYPES:
                of = family_of(stated.tag)
                unit, items = self._definitions.unit(stated), self._definitions.items(stated)
                return Connector(causality, of, unit, items)
        return Connector(causality)


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


#: Elements and attributes of annotations that hold the step of a whole system: those of libcosim
#: and ecos, of Vico, and of OMSimulator.
_STEPS = (
    ("FixedStepAlgorithm", "baseStepSize"),
    ("FixedStepMaster", "baseStepSize"),
    ("FixedStepMaster", "stepSize"),
    ("SimulationInformation", "fixedStepSize"),
)

#: The same of a component.
_STEPS_OF_COMPONENTS = (("StepSizeHint", "value"),)

_ROOT = "SystemStructureDescription"


def read_ssp(path: Path, variant: str | None = None, findings: Findings | None = None) -> System:
    """Read the system in an SSP archive, or in the folder of one that is unpacked.

    Args:
        path: of the archive, the folder, or a description in it.
        variant: which of its descriptions; None: the default.
        findings: takes all that is wrong with it.

    Raises:
        InputError: the archive is missing, broken, or uses what this master cannot do.

    """
    findings = Findings() if findings is None else findings
    archive = Archive(path, findings)
    root = archive.structure(variant)
    content = root.find("System")
    if root.tag != _ROOT or content is None:
        raise InputError(f"{path}: not a readable SSP: it describes no system")
    try:
        system = _read(archive, root, content)
    except RecursionError:
        raise InputError(f"{path}: not a readable SSP: nested too deeply") from None
    findings.refuse()
    return system


def read_parameter_set(
    path: Path, component: Component, findings: Findings
) -> Mapping[PortName, Value]:
    """Read a parameter set of one component, without a prefix or a mapping.

    Args:
        path: of the SSV.
        component: whose parameters it sets.
        findings: takes all that is wrong with it.

    Raises:
        InputError: the set cannot be read, or a value is not of the type of its variable.

    """
    root = Element(_ROOT)
    content = SubElement(root, "System", name=component.name)
    element = SubElement(
        SubElement(content, "Elements"),
        "Component",
        name=component.name,
        source=quote(str(component.fmu.resolve())),
    )
    bindings = SubElement(element, "ParameterBindings")
    SubElement(bindings, "ParameterBinding", source=quote(path.name))
    system = _read(Archive(path.parent, findings), root, content)
    findings.refuse()
    return system.parameters


def _read(archive: Archive, root: Element, content: Element) -> System:
    definitions = definitions_of(archive, root, Definitions())
    experiment = root.find("DefaultExperiment")
    top = Builder(archive, definitions).group(content)
    leaves = {leaf.way: leaf for leaf in top.elements() if isinstance(leaf, Leaf)}
    segments = segments_of(archive, top)
    ports = _Ports(archive, leaves, segments, Bindings(archive, definitions).values(top))
    components: dict[str, Component] = {}
    for leaf in leaves.values():
        name = ".".join(leaf.way)
        if name in components:
            archive.problem(f"two components are named {name}")
        if leaf.component is not None:
            components[name] = leaf.component
    stated = _annotated(experiment, ORDER)
    ordered = [element.get("name", "") for order in stated for element in order]
    components = {name: components[name] for name in (*ordered, *components) if name in components}
    # A component whose step is zero has no wish.
    steps = {
        ".".join(way): step
        for way, leaf in leaves.items()
        if (step := _step(archive, _STEPS_OF_COMPONENTS, leaf.content))
    }
    system = System(
        name=content.get("name") or archive.path.resolve().stem,
        components=components,
        connections=tuple(ports.connections),
        parameters=ports.parameters,
        start_time=archive.number(experiment, "startTime", None),
        stop_time=archive.number(experiment, "stopTime", None),
        step=_step(archive, _STEPS, experiment, content, root),
        steps=steps,
        left_open={
            PortName(element.get("component", ""), element.get("name", ""))
            for left_open in _annotated(experiment, LEFT_OPEN)
            for element in left_open
        },
    )
    if not leaves:
        archive.problem("holds no component: there is nothing to run")
    for problem in system.problems():
        archive.problem(problem)
    return system


def _annotated(element: Element | None, name: str) -> Iterator[Element]:
    """Elements of a name in the annotations of an element itself."""
    if element is not None:
        for annotations in element.findall("Annotations"):
            yield from annotations.iter(name)


def _step(
    archive: Archive, words: Iterable[tuple[str, str]], *places: Element | None
) -> float | None:
    """The step that the annotations of some places ask for [s]; None: they do not say."""
    for name, attribute in words:
        for element in chain.from_iterable(_annotated(place, name) for place in places):
            if (step := archive.number(element, attribute, None)) is not None:
                return step
    return None


@dataclass(frozen=True)
class _Arrival:
    """What is known of a value at a node.

    Attributes:
        start: where it sets out: at a component's port, or where it is given; None: there is none.
        leaf: the component that it comes from; None: it is given.
        whole: its transformation since.
        unit: that it has.
        error: why it cannot come so far.

    """

    start: Node | None
    leaf: Leaf | None = None
    whole: Transformation | None = None
    unit: Unit | None = None
    error: InputError | None = None


class _Ports:
    """What feeds and what sets the ports of components.

    Attributes:
        connections: between components.
        parameters: values of ports that nothing feeds, in the types of their variables.

    """

    def __init__(
        self,
        archive: Archive,
        leaves: Mapping[Way, Leaf],
        segments: Mapping[Node, Segment],
        given: Values,
    ) -> None:
        """Follow each port upstream."""
        self.connections: list[Connection] = []
        self.parameters: dict[PortName, Value] = {}
        self._archive, self._leaves = archive, leaves
        self._segments, self._given = segments, given
        self._used: set[Node] = set()
        self._arrivals: dict[Node, _Arrival] = {}
        self._circling: set[Node] = set()
        for node in dict.fromkeys((*segments, *given)):
            leaf = leaves.get(node.way)
            if leaf is not None and leaf.component is not None:
                try:
                    self._enter(PortName(leaf.component.name, node.port), node, leaf)
                except InputError as error:
                    archive.problem(error)
        lost = [str(node) for node in given if node not in self._used]
        if lost:
            archive.note(f"values that are given to {listed(lost)} reach no component")

    def _enter(self, port: PortName, node: Node, leaf: Leaf) -> None:
        """Enter what arrives at a port: another's value, or the outermost that is given."""
        arrival = self._arrival(node) if node in self._segments else self._given_to(node)
        if arrival.leaf is None:
            self._set(port, leaf, arrival)
        elif arrival.start is not None and arrival.leaf.component is not None:
            source = PortName(arrival.leaf.component.name, arrival.start.port)
            if arrival.error is not None:
                raise InputError(f"{source} -> {port}: {arrival.error}")
            self.connections.append(Connection(source, port, arrival.whole))

    def _arrival(self, node: Node) -> _Arrival:
        """What is known of a value at a node.

        It is followed upstream to what another port has been followed through: so all of them take
        linear time.

        Raises:
            InputError: its connections lead in a circle.

        """
        upstream: dict[Node, Segment] = {}
        at = node
        while at not in self._arrivals and (segment := self._segments.get(at)) is not None:
            if at in upstream or segment.source in self._circling:
                self._circling.update(upstream, [at])
                raise InputError(f"{node}: the connections that feed it form a circle")
            upstream[at] = segment
            at = segment.source
        arrival = self._arrivals.get(at) or self._setting_out(at)
        self._arrivals[at] = arrival
        for target, segment in reversed(upstream.items()):
            arrival = self._arrivals[target] = self._carried(arrival, target, segment)
        return arrival

    def _setting_out(self, node: Node) -> _Arrival:
        """A node that no connection ends in."""
        leaf = self._leaves.get(node.way)
        if leaf is None:
            return self._given_to(node)
        connector = leaf.connector(node.port)
        return _Arrival(node, leaf, unit=connector.unit if connector else None)

    def _carried(self, before: _Arrival, node: Node, segment: Segment) -> _Arrival:
        """What arrives at the end of a connection."""
        if before.start is None:
            return self._given_to(node)
        self._used.add(node)
        if before.leaf is not None and node in self._given:
            self._archive.note(
                f"{node}: is fed by {before.start}, and the value that is given to it has no effect"
            )
        if before.error is not None or (before.leaf and before.leaf.component is None):
            return before
        try:
            whole, unit = segment.carry(self._archive, before.whole, before.unit)
        except InputError as error:
            return replace(before, error=error)
        return replace(before, whole=whole, unit=unit)

    def _given_to(self, node: Node) -> _Arrival:
        """A node that no value has come to before: there begins the one that is given to it."""
        self._used.add(node)
        if node not in self._given:
            return _Arrival(None)
        given, connector = self._given[node]
        return _Arrival(node, unit=connector.unit or given.unit)

    def _set(self, port: PortName, leaf: Leaf, arrival: _Arrival) -> None:
        """Give a port the value that arrives, if any does."""
        if arrival.start is None:
            return
        given, target = self._given[arrival.start]
        try:
            whole = given.transformation(self._archive, target)
            if arrival.error is not None:
                raise arrival.error
            whole = combine(whole, arrival.whole)
        except ValueError as error:
            raise InputError(f"{arrival.start}: {error}") from None
        component, connector = leaf.component, leaf.connector(port.port)
        if component is None or connector is None:
            return
        if connector.causality == "structuralParameter":
            self._keep_size(port, component, given.text)
            return
        if not component.is_settable(port.port):
            self._archive.note(
                f"{port}: has causality {connector.causality} and cannot be set; the value that "
                "is given to it has no effect"
            )
            return
        items = {**connector.items, **given.items}
        value: object = items.get(given.text, given.text)
        if whole is not None:
            value = whole(_number(port, str(value), isinstance(whole, Mapped)))
        if isinstance(value, float) and value.is_integer() and connector.type != "Real":
            value = int(value)
        self.parameters[port] = component.variable(port.port).typed(value, str(port))

    def _keep_size(self, port: PortName, component: Component, text: str) -> None:
        """Refuse another size of arrays than the one that their FMU describes."""
        if component.variable(port.port).typed(text, str(port)) != component.start(port.port):
            raise InputError(f"{port} = {shortened(text)}: sizes of arrays cannot be changed")


def _number(port: PortName, text: str, is_mapped: bool) -> float:
    """A value that is transformed, as a number; one that is mapped is exact."""
    if is_mapped:
        with suppress(ValueError):
            return integer(text)
    try:
        return float(BOOLEANS[text]) if text in BOOLEANS else real(text)
    except ValueError:
        raise InputError(
            f"{port} = {shortened(text)}: not a number, so it can be neither converted nor "
            "transformed"
        ) from None
