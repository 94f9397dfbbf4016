"""Units and enumerations of a file, and what its mappings do to a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import Archive, number
from orchestrator.machine.errors import InputError
from orchestrator.system.units import BASES, Linear, Mapped, Transformation, Unit, Units
from orchestrator.system.values import BOOLEANS

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
