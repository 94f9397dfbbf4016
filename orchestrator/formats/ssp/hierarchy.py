"""Systems in systems, down to the components, with the connectors of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.definitions import Items
from orchestrator.system.component import Component
from orchestrator.system.units import Unit, Units, unit_of_port
from orchestrator.system.values import type_of

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
