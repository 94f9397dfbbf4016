"""The systems in a description, down to their components, with the connectors of all of them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import prod
from typing import TypeAlias
from xml.etree.ElementTree import Element

from orchestrator.cosim.formats.ssp.archive import Archive
from orchestrator.cosim.system.component import Component, read_component
from orchestrator.cosim.system.units import BASE_UNITS, Unit, Units, unit_of_port
from orchestrator.cosim.system.values import family_of
from orchestrator.cosim.system.variables import MOST_ELEMENTS, element_names
from orchestrator.machine.errors import InputError, listed
from orchestrator.machine.texts import integer

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
