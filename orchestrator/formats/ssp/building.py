"""From the elements of a description to its systems, with their components and connectors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import Archive, listed
from orchestrator.formats.ssp.definitions import Definitions
from orchestrator.formats.ssp.hierarchy import Bus, Connector, Group, Leaf, Node, Way
from orchestrator.machine.errors import InputError
from orchestrator.system.component import Component, read_component

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
