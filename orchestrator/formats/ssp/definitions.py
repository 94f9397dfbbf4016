"""Units and enumerations, as each file of an archive defines those that it needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import Archive
from orchestrator.system.units import BASES, Unit, Units

#: An enumeration's values by the names of its items.
Items: TypeAlias = Mapping[str, int]


@dataclass(frozen=True)
class Definitions:
    """Units and enumerations by their names."""

    units: Units = field(default_factory=dict)
    enumerations: Mapping[str, Items] = field(default_factory=dict)

    def and_those_of(self, inner: Definitions) -> Definitions:
        """These, and those of another file, which win."""
        return Definitions(
            {**self.units, **inner.units}, {**self.enumerations, **inner.enumerations}
        )

    def unit(self, element: Element) -> Unit | None:
        """The unit that a type or a value is stated in; None: it states none."""
        name = element.get("unit")
        return self.units.get(name, Unit(name)) if name else None

    def items(self, element: Element) -> Items:
        """Those of the enumeration that a type or a value names; empty where there is none."""
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
