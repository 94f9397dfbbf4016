"""Read an SSP archive as a system with its experiment."""

from __future__ import annotations

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
from orchestrator.machine.disk import has_slash
from orchestrator.machine.errors import Findings, InputError, did_you_mean, listed, shortened
from orchestrator.machine.texts import BOOLEANS, finite, integer, real, whole

#: Values of an enumeration by item.
Items: TypeAlias = Mapping[str, int]

#: Names of a system and of the systems around it, without the outermost.
SystemPath: TypeAlias = tuple[str, ...]

#: Kinds of connectors whose value leaves the element, and whose value enters it.
GIVES = ("output", "calculatedParameter", "constant", "local", "independent")
TAKES = ("input", "parameter", "structuralParameter")

_FMU = "application/x-fmu-sharedlibrary"

#: Child elements of a connector that are not its type.
_NO_TYPES = ("Dimension", "Clock", "ConnectorGeometry", "Annotations")


@dataclass(frozen=True)
class Definitions:
    """Units and enumerations by name."""

    units: Units = field(default_factory=dict)
    enumerations: Mapping[str, Items] = field(default_factory=dict)

    def unit(self, element: Element) -> Unit | None:
        """Return the unit of a type or a value, or None."""
        name = element.get("unit")
        return self.units.get(name, Unit(name)) if name else None

    def items(self, element: Element) -> Items:
        """Return the items of the enumeration of a type or a value, if it is one."""
        return self.enumerations.get(element.get("name", ""), {})


def definitions_of(archive: Archive, root: Element, outer: Definitions) -> Definitions:
    """Return the definitions of a file, which replace those around it."""
    units = dict(outer.units)
    for unit in root.findall("Units/Unit"):
        name, base = unit.get("name", ""), unit.find("BaseUnit")
        if base is not None:
            units[name] = Unit(
                name,
                tuple(archive.integer(base, exponent) for exponent in BASE_UNITS),
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
    """Return the lengths of an array in a connector or parameter; empty: it is a scalar.

    Raises:
        ValueError: a length is missing or not usable.

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
        way: names of the systems and of the element.
        port: name of the connector.

    """

    way: SystemPath
    port: str

    def __str__(self) -> str:
        """Format with dots, like parameters and columns."""
        return ".".join((*self.way, self.port))


@dataclass(frozen=True)
class Connector:
    """A connector of a system or of an element, as the file states it.

    Attributes:
        causality: None: not stated.
        type: in FMI 2.0, or its equivalent there; None: not stated.
        unit: None: not stated.
        items: of an enumeration.
        elements: names of an array's elements, which are also connectors.

    """

    causality: str | None = None
    type: str | None = None
    unit: Unit | None = None
    items: Items = field(default_factory=dict)
    elements: tuple[str, ...] = ()


@dataclass(frozen=True)
class ComponentElement:
    """A component in the file.

    Attributes:
        way: its names, from the outermost system on.
        content: element of the file.
        component: None: its FMU cannot be read, which is a problem already.
        connectors: in the file.
        units: defined in the file.

    """

    way: SystemPath
    content: Element
    component: Component | None
    connectors: Mapping[str, Connector]
    units: Units

    def connector(self, name: str) -> Connector | None:
        """Return a connector as the FMU has it; None: there is no such connector."""
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
        """Yield the variable of a name, if there is one.

        Raises:
            InputError: its type is not supported.

        """
        if self.component is None:
            return
        if name in self.component.unsupported:
            self.component.variable(name)
        if (connector := self.connector(name)) is not None:
            yield Node(self.way, name), connector


@dataclass(frozen=True)
class DictionaryReference:
    """A reference to a signal dictionary: all references to one share its signals.

    Attributes:
        way: of the dictionary.
        content: element of the reference in the file.
        connectors: in the file.

    """

    way: SystemPath
    content: Element
    connectors: Mapping[str, Connector]

    def connector(self, name: str) -> Connector | None:
        """Return a connector, whose signal may go either way."""
        stated = self.connectors.get(name)
        return None if stated is None else replace(stated, causality=None)

    def named(self, _: str) -> Iterator[tuple[Node, Connector]]:
        """Yield nothing: a dictionary has no values."""
        yield from ()


@dataclass(frozen=True)
class SystemElement:
    """A system in the file.

    Attributes:
        way: its names, without the outermost system.
        content: element of the file.
        connectors: of the system itself.
        members: elements in it, by name.

    """

    way: SystemPath
    content: Element
    connectors: Mapping[str, Connector]
    members: Mapping[str, _AnyElement]

    def connector(self, name: str) -> Connector | None:
        """Return one of its connectors; None: there is no such connector."""
        return self.connectors.get(name)

    def named(self, name: str) -> Iterator[tuple[Node, Connector]]:
        """Yield all connectors and variables in it of a name, whose dots may be ambiguous."""
        if name in self.connectors:
            yield Node(self.way, name), self.connectors[name]
        for member, element in self.members.items():
            if name.startswith(f"{member}."):
                yield from element.named(name[len(member) + 1 :])

    def elements(self) -> Iterator[_AnyElement]:
        """Yield the system, then all elements in it, each system before its elements."""
        yield self
        for element in self.members.values():
            if isinstance(element, SystemElement):
                yield from element.elements()
            else:
                yield element


#: An element of a system in the file.
_AnyElement: TypeAlias = ComponentElement | DictionaryReference | SystemElement


class Builder:
    """Reads the systems of a description."""

    def __init__(self, archive: Archive, definitions: Definitions) -> None:
        """Take the archive and the definitions of its description."""
        self._archive, self._definitions = archive, definitions

    def group(
        self, content: Element, way: SystemPath = (), buses: Mapping[str, SystemPath] | None = None
    ) -> SystemElement:
        """Read a system with everything in it.

        Args:
            content: element of the file.
            way: names of the system.
            buses: signal dictionaries of the systems around it, by name.

        """
        own = content.findall("SignalDictionaries/SignalDictionary")
        buses = {
            **(buses or {}),
            **{name: (*way, name, "") for d in own if (name := d.get("name"))},
        }
        members: dict[str, _AnyElement] = {}
        for element in content.findall("Elements/*"):
            name = element.get("name", "")
            if not name or has_slash(name):
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
                    members[name] = DictionaryReference(
                        buses[bus], element, self._connectors(element)
                    )
                else:
                    self._archive.problem(f"{name}: there is no signal dictionary {bus!r}")
            else:
                self._archive.problem(f"{name}: a <{element.tag}> in a system is not supported")
        return SystemElement(way, content, self._connectors(content), members)

    def _leaf(self, content: Element, way: SystemPath) -> ComponentElement:
        component = self._component(content, ".".join(way))
        connectors = self._connectors(content)
        leaf = ComponentElement(way, content, component, connectors, self._definitions.units)
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

    def _compare(self, leaf: ComponentElement) -> None:
        """Add notes where connectors differ from their FMU."""
        absent = []
        elements = {name for stated in leaf.connectors.values() for name in stated.elements}
        unsupported = leaf.component.unsupported if leaf.component else {}
        for name, stated in leaf.connectors.items():
            own = leaf.connector(name)
            if name in unsupported or (own is not None and name in elements):
                continue
            if own is None:
                absent.append(name)
                continue
            for what, value, true in (
                ("kind", stated.causality, own.causality),
                ("type", stated.type, own.type),
                ("unit", stated.unit and stated.unit.name, own.unit and own.unit.name),
            ):
                if value and value != true:
                    self._archive.note(
                        f"{Node(leaf.way, name)}: its {what} is {value}, but {true} in its FMU"
                    )
        if absent:
            self._archive.note(
                f"{'.'.join(leaf.way)}: its FMU has no variables for the connectors "
                f"{listed(absent)}"
            )

    def _connectors(self, content: Element) -> dict[str, Connector]:
        connectors: dict[str, Connector] = {}
        for connector in content.findall("Connectors/Connector"):
            name, stated = connector.get("name", ""), self._connector(connector)
            elements: tuple[str, ...] = ()
            try:
                if shape := shape_of(connector):
                    elements = tuple(element_names(name, shape))
            except ValueError as error:
                # For a component, the FMU decides.
                if content.tag != "Component":
                    self._archive.problem(f"{content.get('name', '')}.{name} {error}")
            connectors |= {
                name: replace(stated, elements=elements),
                **dict.fromkeys(elements, stated),
            }
        return connectors

    def _connector(self, connector: Element) -> Connector:
        causality = connector.get("kind")
        for stated in connector:
            if stated.tag not in _NO_TYPES:
                family = family_of(stated.tag)
                unit, items = self._definitions.unit(stated), self._definitions.items(stated)
                return Connector(causality, family, unit, items)
        return Connector(causality)


_TABLES = (
    "BooleanMappingTransformation", "IntegerMappingTransformation",
    "EnumerationMappingTransformation",
)  # fmt: skip

#: Supported types of files.
_VALUES, _MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"


def _transformation(content: Element, source: Items, target: Items) -> Transformation | None:
    """Return the transformation of a connection or an entry of a mapping; None: there is none.

    Args:
        content: element of the connection or entry.
        source, target: items of the enumerations at its ends.

    Raises:
        ValueError: it is wrong.

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
    """Return a value of a mapping, as FMI's number."""
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
    """Return True if units are converted in a connection or an entry of a mapping."""
    return not BOOLEANS.get(content.get("suppressUnitConversion", "false"), False)


@dataclass(frozen=True)
class Segment:
    """A connection of the file, which ends in a node.

    Attributes:
        source: origin of its value.
        unit: of its target; None: the unit that arrives.
        stated: transformation of the value, after the conversion of its unit.
        converts: True if its unit is converted.

    """

    source: Node
    unit: Unit | None
    stated: Transformation | None
    converts: bool

    def carry(
        self, archive: Archive, whole: Transformation | None, unit: Unit | None
    ) -> tuple[Transformation | None, Unit | None]:
        """Return the transformation and the unit of a value at the segment's end.

        Args:
            archive: with the connection.
            whole: transformation of the value until the segment.
            unit: of the value at the segment's begin.

        Raises:
            InputError: units do not fit, or transformations cannot be combined.

        """
        step = self.stated
        if self.converts:
            step = combine(archive.conversion(unit, self.unit), step)
            # A transformed value has the target's unit, or an unknown one.
            unit = self.unit or (unit if self.stated is None else None)
        else:
            # Stated even if it changes nothing: the units at the ends may differ.
            step, unit = step or Linear(), self.unit
        return combine(whole, step), unit


def segments_of(archive: Archive, top: SystemElement) -> dict[Node, Segment]:
    """Return the connections in a system, by the nodes in which they end.

    A wrong connection is a problem of the archive.
    """
    segments: dict[Node, Segment] = {}
    for group in top.elements():
        if isinstance(group, SystemElement):
            for connection in group.content.findall("Connections/Connection"):
                try:
                    _add(segments, group, connection)
                except InputError as error:
                    archive.problem(error)
    return segments


def _add(segments: dict[Node, Segment], group: SystemElement, connection: Element) -> None:
    start, end = (_End.of(group, connection, which) for which in ("start", "end"))
    named = f"{start.node} -> {end.node}"
    if (start.takes and end.takes) or (start.gives and end.gives):
        both = "take a value" if start.takes else "give one"
        raise InputError(f"{named}: cannot be connected, as both {both}")
    # SSP allows a connection to be written from either end.
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
        if (before := segments.get(stop)) is not None:
            raise InputError(
                f"{stop} is fed by {before.source} and by {begin}; an input takes one connection"
            )
        segments[stop] = Segment(begin, unit, stated, converts)


@dataclass(frozen=True)
class _End:
    """An end of a connection, seen from the system of the connection.

    Attributes:
        node: of the end.
        connector: of the end.
        gives, takes: direction of its value; neither: either is possible.

    """

    node: Node
    connector: Connector
    gives: bool
    takes: bool

    @property
    def indices(self) -> list[str]:
        """Suffixes of the names of its elements; a scalar has an empty one."""
        return _indices(self.node, self.connector)

    def element(self, index: str) -> Node:
        """Return the node of one of its elements."""
        return Node(self.node.way, self.node.port + index)

    @classmethod
    def of(cls, group: SystemElement, connection: Element, which: str) -> _End:
        """Read the start or the end of a connection."""
        # Some tools leave the element empty for the system itself.
        name, port = connection.get(f"{which}Element") or None, connection.get(f"{which}Connector")
        if not port:
            raise InputError(f"a <{connection.tag}> without {which}Connector")
        if indices := connection.get(f"{which}Indices"):
            port = f"{port}[{','.join(indices.split())}]"
        element: _AnyElement | None = group if name is None else group.members.get(name)
        if element is None:
            raise InputError(
                f"a connection to {Node((*group.way, name or ''), port)}: "
                f"there is no element {name!r}{did_you_mean(name or '', group.members)}"
            )
        connector = element.connector(port)
        if connector is None:
            if isinstance(element, ComponentElement) and element.component is not None:
                element.component.variable(port)
            raise InputError(
                f"a connection to {Node(element.way, port)}, which does not exist"
                f"{did_you_mean(port, element.connectors)}"
            )
        outwards, inwards = connector.causality in GIVES, connector.causality in TAKES
        # From inside, the inputs of a system give values and its outputs take them.
        gives, takes = (inwards, outwards) if element is group else (outwards, inwards)
        return cls(Node(element.way, port), connector, gives, takes)


def _indices(node: Node, connector: Connector) -> list[str]:
    """Return the suffixes of an array's elements; a scalar has an empty one."""
    return [name.removeprefix(node.port) for name in connector.elements] or [""]


@dataclass(frozen=True)
class Given:
    """A value of a parameter set, and its changes on the way to a node.

    Attributes:
        text: of the value.
        unit: of the value; None: the node's unit.
        items: of its enumeration; empty: those of the variable.
        entry: of the mapping for it.

    """

    text: str
    unit: Unit | None = None
    items: Items = field(default_factory=dict)
    entry: Element | None = None

    def transformation(self, archive: Archive, target: Connector) -> Transformation | None:
        """Return the transformation to the value of a node.

        Raises:
            ValueError: units do not fit, or the mapping is wrong.

        """
        stated = None
        if self.entry is not None:
            stated = _transformation(self.entry, self.items, target.items)
            if not _converts_units(self.entry):
                return stated
        return combine(archive.conversion(self.unit, target.unit), stated)


#: Values that are given to nodes, with the connectors of these.
Values: TypeAlias = dict[Node, tuple[Given, Connector]]

#: Values of a parameter's elements by the suffixes of their names; a scalar has an empty one.
_Elements: TypeAlias = dict[str, Given]


class Bindings:
    """The values of all parameter sets of a description."""

    def __init__(self, archive: Archive, definitions: Definitions) -> None:
        """Take the archive and the definitions of its description."""
        self._archive, self._definitions = archive, definitions

    def values(self, top: SystemElement) -> Values:
        """Return the values that are given to nodes.

        If several are given to one node, the outer system wins, then the later set.
        """
        given: Values = {}
        for element in _inside_out(top):
            for binding in element.content.findall("ParameterBindings/ParameterBinding"):
                try:
                    self._apply(binding, element, given)
                except InputError as error:
                    self._archive.problem(error)
        return given

    def _apply(self, binding: Element, element: _AnyElement, given: Values) -> None:
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
                reached = {node: (value, target) for node, target in element.named(name + index)}
                given.update(reached)
                if not reached:
                    unknown.append(name + index)
        if unknown and not (isinstance(element, ComponentElement) and element.component is None):
            self._archive.note(
                f"{where} has nothing named {listed(unknown)}; values for it have no effect"
            )

    def _content(
        self, element: Element, owner: _AnyElement, where: str, inline: str, media_type: str
    ) -> Element | None:
        """Return the content of an element, or of the file that it names."""
        stated = element.get("type", media_type)
        if stated != media_type:
            self._archive.problem(f"{where}: parameters of type {stated!r} are not supported")
            return None
        source = element.get("source")
        if source is None:
            content = element.find(inline)
            if content is None:
                self._archive.note(f"{where}: a <{element.tag}> without content")
            return content
        base = None
        if element.get("sourceBase", "SSD") != "SSD":
            if not isinstance(owner, ComponentElement) or owner.component is None:
                named = ".".join(owner.way)
                raise InputError(f"a file of {named!r}, which is not a component with an FMU")
            base = owner.component.folder
        file = self._archive.file(source, where, base)
        return None if file is None else self._archive.read(file)

    def _mapped(
        self, parameters: dict[str, _Elements], mapping: Element, where: str
    ) -> dict[str, _Elements]:
        """Return the parameters in a mapping, under their new names."""
        renamed = {}
        for entry in mapping.findall("MappingEntry"):
            source, target = (
                self._archive.required(entry, end, where) for end in ("source", "target")
            )
            if source in parameters:
                values = parameters[source].items()
                renamed[target] = {index: replace(given, entry=entry) for index, given in values}
        return renamed

    def _parameters(self, values: Element, where: str) -> dict[str, _Elements]:
        """Return the values of a parameter set by name."""
        definitions = definitions_of(self._archive, values, self._definitions)
        parameters: dict[str, _Elements] = {}
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
            if name in parameters:
                self._archive.note(f"{where}: {name} appears twice in a parameter set")
            unit, items = definitions.unit(value), definitions.items(value)
            pairs = zip(indices, texts, strict=True)
            parameters[name] = {index: Given(text, unit, items) for index, text in pairs}
        return parameters


def _texts(value: Element, is_array: bool) -> list[str]:
    """Return the values of a parameter, in the order of an array's elements."""
    if is_array and family_of(value.tag) in ("Real", "Integer", "Boolean"):
        return value.get("value", "").split()
    several = value.findall("Value")
    return [text for element in several or [value] if (text := element.get("value")) is not None]


def _inside_out(group: SystemElement) -> Iterator[_AnyElement]:
    """Yield all elements of a system, each system after its elements."""
    for element in group.members.values():
        if isinstance(element, SystemElement):
            yield from _inside_out(element)
        else:
            yield element
    yield group


#: Elements and attributes of annotations with the step of a system, in libcosim and ecos, Vico, and
#: OMSimulator.
_STEPS = (
    ("FixedStepAlgorithm", "baseStepSize"),
    ("FixedStepMaster", "baseStepSize"),
    ("FixedStepMaster", "stepSize"),
    ("SimulationInformation", "fixedStepSize"),
)

#: The same for components.
_STEPS_OF_COMPONENTS = (("StepSizeHint", "value"),)

_ROOT = "SystemStructureDescription"


def read_ssp(path: Path, variant: str | None = None, findings: Findings | None = None) -> System:
    """Read the system of an SSP archive, or of the folder of an unpacked one.

    Args:
        path: of the archive, the folder, or a description in it.
        variant: name of a description; None: the default.
        findings: receives problems and notes.

    Raises:
        InputError: the archive is missing, broken, or uses unsupported features.

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
        component: with the parameters.
        findings: receives problems and notes.

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
    leaves = {leaf.way: leaf for leaf in top.elements() if isinstance(leaf, ComponentElement)}
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
    # A component with a step of zero has no step of its own.
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
    """Yield elements of a name in the annotations of an element itself."""
    if element is not None:
        for annotations in element.findall("Annotations"):
            yield from annotations.iter(name)


def _step(
    archive: Archive, words: Iterable[tuple[str, str]], *places: Element | None
) -> float | None:
    """Return the step in the annotations of some elements [s]; None: there is none."""
    for name, attribute in words:
        for element in chain.from_iterable(_annotated(place, name) for place in places):
            if (step := archive.number(element, attribute, None)) is not None:
                return step
    return None


@dataclass(frozen=True)
class _Arrival:
    """A value at a node.

    Attributes:
        start: origin of the value: a component's port, or the node to which it is given; None: no
            value.
        leaf: component of the origin; None: the value is given.
        whole: transformation on the way.
        unit: of the value.
        error: reason why the value cannot arrive.

    """

    start: Node | None
    leaf: ComponentElement | None = None
    whole: Transformation | None = None
    unit: Unit | None = None
    error: InputError | None = None


class _Ports:
    """The connections and parameters of components.

    Attributes:
        connections: between components.
        parameters: values of unconnected ports, in the types of their variables.

    """

    def __init__(
        self,
        archive: Archive,
        leaves: Mapping[SystemPath, ComponentElement],
        segments: Mapping[Node, Segment],
        given: Values,
    ) -> None:
        """Follow each port to its origin."""
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

    def _enter(self, port: PortName, node: Node, leaf: ComponentElement) -> None:
        """Enter the value that arrives at a port: another port's, or a given one."""
        arrival = self._arrival(node) if node in self._segments else self._given_to(node)
        if arrival.leaf is None:
            self._set(port, leaf, arrival)
        elif arrival.start is not None and arrival.leaf.component is not None:
            source = PortName(arrival.leaf.component.name, arrival.start.port)
            if arrival.error is not None:
                raise InputError(f"{source} -> {port}: {arrival.error}")
            self.connections.append(Connection(source, port, arrival.whole))

    def _arrival(self, node: Node) -> _Arrival:
        """Return the value at a node.

        The search ends where an earlier one has passed, so that all of them together take linear
        time.

        Raises:
            InputError: its connections form a circle.

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
        """Return the value at a node that no connection ends in."""
        leaf = self._leaves.get(node.way)
        if leaf is None:
            return self._given_to(node)
        connector = leaf.connector(node.port)
        return _Arrival(node, leaf, unit=connector.unit if connector else None)

    def _carried(self, before: _Arrival, node: Node, segment: Segment) -> _Arrival:
        """Return the value at the end of a connection."""
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
        """Return the value that is given to a node without another one."""
        self._used.add(node)
        if node not in self._given:
            return _Arrival(None)
        given, connector = self._given[node]
        return _Arrival(node, unit=connector.unit or given.unit)

    def _set(self, port: PortName, leaf: ComponentElement, arrival: _Arrival) -> None:
        """Set a port to the value that arrives, if there is one."""
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
        """Refuse to change the sizes of arrays."""
        if component.variable(port.port).typed(text, str(port)) != component.start(port.port):
            raise InputError(f"{port} = {shortened(text)}: sizes of arrays cannot be changed")


def _number(port: PortName, text: str, is_mapped: bool) -> float:
    """Return a number to be transformed; for a mapping it is exact."""
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
