"""Systems in systems, down to the components, with the connectors of all of them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import Archive, listed, number
from orchestrator.machine.errors import InputError
from orchestrator.system.component import Component, read_component
from orchestrator.system.units import (
    BASES,
    Linear,
    Mapped,
    Transformation,
    Unit,
    Units,
    unit_of_port,
)
from orchestrator.system.values import BOOLEANS, type_of

#: An enumeration's values by the names of its items.
Items: TypeAlias = Mapping[str, int]


@dataclass(frozen=True)
class Definitions:
    """Units and enumerations by their names."""

    units: Units = field(default_factory=dict)
    enumerations: Mapping[str, Items] = field(default_factory=dict)

    def with_inner(self, inner: Definitions) -> Definitions:
        """These definitions and another file's, which win."""
        return Definitions(
            {**self.units, **inner.units}, {**self.enumerations, **inner.enumerations}
        )

    def unit(self, element: Element) -> Unit | None:
        """The unit that a type or a value is stated in; None: it states none."""
        name = element.get("unit")
        return self.units.get(name, Unit(name)) if name else None

    def items(self, element: Element) -> Items:
        """The items of the enumeration that a type or a value names; empty where there is none."""
        return self.enumerations.get(element.get("name", ""), {})


def definitions_of(archive: Archive, root: Element) -> Definitions:
    """What a file defines."""
    units = {}
    for unit in root.findall("Units/Unit"):
        name, base = unit.get("name", ""), unit.find("BaseUnit")
        if base is not None:
            units[name] = Unit(
                name,
                tuple(archive.integer(base, of) for of in BASES),
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
    return Definitions(units, enumerations)


_LINEAR = "LinearTransformation"
_TABLES = (
    "BooleanMappingTransformation", "IntegerMappingTransformation",
    "EnumerationMappingTransformation",
)  # fmt: skip


def transformation_of(content: Element, source: Items, target: Items) -> Transformation | None:
    """The transformation in a connection or an entry of a mapping; None: there is none.

    Args:
        content: element of the connection or entry.
        source, target: values of the enumerations at its ends, if there are any.

    Raises:
        InputError: it has a mistake.

    """
    linear = content.find(_LINEAR)
    if linear is not None:
        return Linear(
            number("factor", linear.get("factor", "1")), number("offset", linear.get("offset", "0"))
        )
    for name in _TABLES:
        table = content.find(name)
        if table is not None:
            entries = table.findall("MapEntry")
            pairs = [
                (_value(name, entry, "source", source), _value(name, entry, "target", target))
                for entry in entries
            ]
            if len(dict(pairs)) < len(pairs):
                raise InputError("a mapping has two entries for one source")
            return Mapped(tuple(pairs))
    return None


def converts_units(content: Element) -> bool:
    """Whether a connection or an entry of a mapping has units converted."""
    return not BOOLEANS.get(content.get("suppressUnitConversion", "false"), False)


def _value(table: str, entry: Element, end: str, items: Items) -> float:
    """One value of a table, as the number that FMI has for it."""
    text = entry.get(end, "")
    if table.startswith("Boolean"):
        if text not in BOOLEANS:
            raise InputError(f"{end} {text!r} of a mapping is neither true nor false")
        return float(BOOLEANS[text])
    if table.startswith("Enumeration"):
        if text not in items:
            raise InputError(f"{end} {text!r} of a mapping is not in its enumeration")
        return float(items[text])
    if (value := number(end, text)) != int(value):
        raise InputError(f"{end} {text!r} of a mapping is no integer")
    return value


#: The names of a system and of the systems around it, except the outermost.
Way: TypeAlias = tuple[str, ...]

#: Which way a value goes, by the kind of an element's connector, seen from the system around it.
GIVES = ("output", "calculatedParameter", "constant", "local", "independent")
TAKES = ("input", "parameter", "structuralParameter")


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
        type: as FMI 2.0 calls it, or what FMI 2.0 does not have; None: it does not say.
        unit: None: it names none.
        items: of an enumeration.

    """

    causality: str | None
    type: str | None
    unit: Unit | None
    items: Items


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
            return self.connectors.get(name, Connector(None, None, None, {}))
        variable = self.component.variables.get(name)
        if variable is None:
            return None
        stated = self.connectors.get(name)
        unit = unit_of_port(self.component, name, self.units)
        if unit is None and stated is not None:
            unit = stated.unit
        declared = variable.declaredType
        items = {} if declared is None else {i.name: int(i.value) for i in declared.items}
        if not items and stated is not None:
            items = dict(stated.items)
        return Connector(variable.causality, type_of(variable), unit, items)

    def named(self, name: str) -> Iterator[tuple[Node, Connector]]:
        """The variable of a name."""
        if self.component is not None and (connector := self.connector(name)) is not None:
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
        return None if stated is None else Connector(None, stated.type, stated.unit, stated.items)

    def named(self, _: str) -> Iterator[tuple[Node, Connector]]:
        """Nothing in it has a value of its own."""
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
        """One of its own connectors; None: it has none of that name."""
        return self.connectors.get(name)

    def named(self, name: str) -> Iterator[tuple[Node, Connector]]:
        """All connectors and variables in it of a name, which several ways may spell."""
        if name in self.connectors:
            yield Node(self.way, name), self.connectors[name]
        for member, element in self.members.items():
            if name.startswith(f"{member}."):
                yield from element.named(name[len(member) + 1 :])

    def leaves(self) -> Iterator[Leaf]:
        """All components in it, in their order."""
        for element in self.members.values():
            if isinstance(element, Group):
                yield from element.leaves()
            elif isinstance(element, Leaf):
                yield element


_FMU = "application/x-fmu-sharedlibrary"

#: Types of connectors, by what SSP 2.0 calls them as well.
_TYPES = {
    "Real": "Real", "Float64": "Real", "Integer": "Integer", "Int32": "Integer",
    "Boolean": "Boolean", "String": "String", "Enumeration": "Enumeration",
}  # fmt: skip

#: What a connector may have besides its type.
_NO_TYPES = ("Dimension", "Clock", "ConnectorGeometry", "Annotations")


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
        buses = {
            **(buses or {}),
            **{
                name: (*way, name, "")
                for dictionary in content.findall("SignalDictionaries/SignalDictionary")
                if (name := dictionary.get("name", ""))
            },
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
                dictionary = element.get("dictionary", "")
                if dictionary in buses:
                    connectors = self._connectors(element)
                    members[name] = Bus(buses[dictionary], element, connectors)
                else:
                    self._archive.problem(f"{name}: there is no signal dictionary {dictionary!r}")
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
        source, kind = content.get("source"), content.get("type", _FMU)
        if kind != _FMU:
            self._archive.problem(
                f"{name}: a component of type {kind!r} is not supported; an FMU is"
            )
        elif source is None:
            self._archive.problem(f"{name}: a component without a source, which cannot be run")
        elif content.get("implementation", "any") not in ("any", "CoSimulation"):
            self._archive.problem(
                f"{name}: asks for {content.get('implementation')}, which is not supported; "
                "CoSimulation is"
            )
        elif (fmu := self._archive.file(source, name)) is not None:
            return self._read(name, fmu)
        return None

    def _read(self, name: str, fmu: Path) -> Component | None:
        try:
            return read_component(name, fmu, findings=self._archive.findings)
        except InputError as error:
            self._archive.problem(f"{name}: {str(error).removeprefix(f'{self._archive.folder}/')}")
            return None

    def _compare(self, leaf: Leaf) -> None:
        """Say where connectors are not what their FMU has."""
        absent = []
        for name, stated in leaf.connectors.items():
            own = leaf.connector(name)
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
                        f"{Node(leaf.way, name)}: its {what} is {said}, and {true} in its FMU"
                    )
        if absent:
            self._archive.note(
                f"{'.'.join(leaf.way)}: its FMU has no variables for the connectors "
                f"{listed(absent)}"
            )

    def _connectors(self, content: Element) -> dict[str, Connector]:
        return {
            connector.get("name", ""): self._connector(connector)
            for connector in content.findall("Connectors/Connector")
        }

    def _connector(self, connector: Element) -> Connector:
        stated = next((child for child in connector if child.tag not in _NO_TYPES), None)
        causality = connector.get("kind")
        if stated is None:
            return Connector(causality, None, None, {})
        of = _TYPES.get(stated.tag, stated.tag)
        return Connector(
            causality, of, self._definitions.unit(stated), self._definitions.items(stated)
        )
