"""Transformations as connections and mappings state them."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import number
from orchestrator.formats.ssp.definitions import Items
from orchestrator.machine.errors import InputError
from orchestrator.system.transformation import Linear, Mapped, Transformation
from orchestrator.system.values import BOOLEANS

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
