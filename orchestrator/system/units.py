"""Units, by their own definitions in FMUs and SSPs, and how a value goes from one to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from sys import float_info
from typing import Any

from orchestrator.machine.errors import InputError
from orchestrator.system.component import Component
from orchestrator.system.transformation import Linear
from orchestrator.system.values import unit_of

#: The base units of FMI 2.0 and SSP 1.0, in the order of :attr:`Unit.exponents`.
BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Unit:
    """A unit: a value in base units is factor * value + offset.

    Attributes:
        name: as connectors and variables write it.
        exponents: of :data:`BASES`; None: nothing defines this unit.

    """

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0


class UndefinedUnit(InputError):
    """A value is to go from one unit to another, of which nothing defines one."""


#: Units by their names.
Units = Mapping[str, Unit]


def _defined(component: Component, name: str) -> Unit:
    """A unit as an FMU defines it."""
    for unit in component.description.unitDefinitions:
        if unit.name == name and unit.baseUnit is not None:
            base: Any = unit.baseUnit
            exponents = tuple(int(getattr(base, of, 0) or 0) for of in BASES)
            return Unit(name, exponents, float(base.factor), float(base.offset))
    return Unit(name)


def unit_of_port(component: Component, port: str, otherwise: Units | None = None) -> Unit | None:
    """The unit of a variable; None: it names none.

    Args:
        component: whose variable it is.
        port: its name.
        otherwise: units that are defined elsewhere, for one that the FMU does not define.

    """
    variable = component.variable(port)
    name = unit_of(variable)
    if not name:
        return None
    unit = _defined(component, name)
    if unit.exponents is None:
        unit = (otherwise or {}).get(name, unit)
    declared = variable.declaredType
    relative = variable.relativeQuantity or (declared is not None and declared.relativeQuantity)
    # A difference of two temperatures has no zero that could be shifted.
    return replace(unit, offset=0.0) if relative else unit


def conversion(source: Unit | None, target: Unit | None) -> Linear | None:
    """From one unit to another; None: the value stays as it is.

    Raises:
        InputError: they measure different things.
        UndefinedUnit: one of them is not defined.

    """
    if source is None or target is None or source.name == target.name:
        return None
    for unit in (source, target):
        if unit.exponents is None:
            raise UndefinedUnit(
                f"units differ, {source.name} and {target.name}, and nothing defines {unit.name}"
            )
        if not (isfinite(unit.factor) and isfinite(unit.offset) and unit.factor):
            raise InputError(f"unit {unit.name} has the factor {unit.factor:g}")
    if source.exponents != target.exponents:
        raise InputError(f"units differ, {source.name} and {target.name}")
    if (source.factor, source.offset) == (target.factor, target.offset):
        return None
    factor = source.factor / target.factor
    offset = (source.offset - target.offset) / target.factor
    if not (float_info.min <= abs(factor) <= float_info.max and isfinite(offset)):
        raise InputError(
            f"units {source.name} and {target.name} are too far apart: a value of one is "
            f"{factor:g} of the other, plus {offset:g}"
        )
    return Linear(factor, offset)
