"""Parameter sets: their values, their mappings, and the connectors and variables they reach."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeAlias
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import Archive, listed
from orchestrator.formats.ssp.hierarchy import (
    Bus,
    Connector,
    Definitions,
    Group,
    Items,
    Leaf,
    Node,
    converts_units,
    definitions_of,
    transformation_of,
)
from orchestrator.machine.errors import InputError
from orchestrator.system.units import Transformation, Unit, chained

#: The types of files that are known.
_VALUES, _MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"


@dataclass(frozen=True)
class Given:
    """A value of a parameter set, and what happens to it on its way to a node.

    Attributes:
        text: the value.
        unit: of the value; None: the node's.
        items: values of its enumeration; empty: the variable's count.
        entry: of the mapping that it came through.
        converts: whether its unit is converted.

    """

    text: str
    unit: Unit | None = None
    items: Items = field(default_factory=dict)
    entry: Element | None = None
    converts: bool = True

    def transformation(self, archive: Archive, target: Connector) -> Transformation | None:
        """What makes of it the value of a node.

        Raises:
            InputError: units do not fit, or the mapping has a mistake.

        """
        stated = None
        if self.entry is not None:
            stated = transformation_of(self.entry, self.items, target.items)
        if not self.converts:
            return stated
        return chained(archive.conversion(self.unit, target.unit), stated)


#: What is given to nodes, and what is known of each of these.
Values: TypeAlias = dict[Node, tuple[Given, Connector]]


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
        for name, value in parameters.items():
            reached = {node: (value, connector) for node, connector in element.named(name)}
            given.update(reached)
            if not reached:
                unknown.append(name)
        if unknown and not (isinstance(element, Leaf) and element.component is None):
            self._archive.note(
                f"{where} has nothing named {listed(unknown)}; values for it have no effect"
            )

    def _content(
        self, element: Element, owner: Leaf | Bus | Group, where: str, inline: str, kind: str
    ) -> Element | None:
        """What an element holds, itself or in the file that it names."""
        stated = element.get("type", kind)
        if stated != kind:
            self._archive.problem(f"{where}: parameters of type {stated!r} are not supported")
            return None
        source = element.get("source")
        if source is None:
            found = element.find(inline)
            if found is None:
                self._archive.note(f"{where}: a <{element.tag}> without content")
            return found
        base = self._base(element.get("sourceBase", "SSD"), owner)
        file = self._archive.file(source, where, base)
        return None if file is None else self._archive.read(file)

    def _base(self, stated: str, owner: Leaf | Bus | Group) -> Path | None:
        """The folder to which the address of a file is relative."""
        if stated == "SSD":
            return None
        if isinstance(owner, Leaf) and owner.component is not None:
            return owner.component.folder
        raise InputError(f"a file of {'.'.join(owner.way)!r}, which is no component with an FMU")

    def _mapped(
        self, parameters: dict[str, Given], mapping: Element, where: str
    ) -> dict[str, Given]:
        """Those parameters that a mapping names, under their new names."""
        found = {}
        for entry in mapping.findall("MappingEntry"):
            source, target = (
                self._archive.required(entry, end, where) for end in ("source", "target")
            )
            if source in parameters:
                found[target] = replace(
                    parameters[source], entry=entry, converts=converts_units(entry)
                )
        return found

    def _parameters(self, values: Element, where: str) -> dict[str, Given]:
        """The values of a parameter set by their names."""
        known = self._definitions.with_inner(definitions_of(self._archive, values))
        found: dict[str, Given] = {}
        for parameter in values.findall("Parameters/Parameter"):
            name = self._archive.required(parameter, "name", where)
            value = next(iter(parameter), None)
            text = None if value is None else value.get("value")
            if value is None or text is None:
                self._archive.problem(f"{where}: {name}: a parameter without a value")
                continue
            if parameter.find("Dimension") is not None:
                self._archive.problem(f"{where}: {name}: arrays are not supported")
                continue
            if name in found:
                self._archive.note(f"{where}: {name} stands twice in a parameter set")
            found[name] = Given(text, known.unit(value), known.items(value))
        return found


def _inside_out(group: Group) -> Iterator[Leaf | Bus | Group]:
    """All elements of a system, each after those in it."""
    for element in group.members.values():
        if isinstance(element, Group):
            yield from _inside_out(element)
        else:
            yield element
    yield group
