"""Transformations of values on their way through a connection, units, and their conversion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from sys import float_info
from typing import Any, TypeAlias

from orchestrator.cosim.system.component import Component
from orchestrator.machine.errors import InputError

#: Values of a mapping that is made of several.
_MOST_PAIRS = 1000

#: The base units of FMI 2.0 and SSP 1.0, in the order of :attr:`Unit.exponents`.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Linear:
    """The target takes factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: float) -> float:
        """The value that arrives."""
        return self.factor * value + self.offset


@dataclass(frozen=True)
class Mapped:
    """The target takes what stands beside the source's value; any other value stays as it is.

    Attributes:
        pairs: values of source and target, truth values as zero and one, integers exact.

    """

    pairs: tuple[tuple[float, float], ...]

    def __call__(self, value: float) -> float:
        """The value that arrives."""
        return dict(self.pairs).get(value, value)


Transformation: TypeAlias = Linear | Mapped


def combine(first: Transformation | None, then: Transformation | None) -> Transformation | None:
    """Combine two transformations, one after the other; None leaves a value as it is.

    Raises:
        InputError: one is linear, and the other a table; no number holds what they come to; or
            together they are too long a table.

    """
    # An identity is kept only if there is no other.
    for nothing in (None, Linear()):
        if first == nothing:
            return then
        if then == nothing:
            return first
    if isinstance(first, Linear) and isinstance(then, Linear):
        both = Linear(then.factor * first.factor, then(first.offset))
        vanishes = not both.factor and first.factor and then.factor
        if vanishes or not (isfinite(both.factor) and isfinite(both.offset)):
            raise InputError(
                f"successive linear transformations combine to the factor "
                f"{both.factor:g} and the offset {both.offset:g}"
            )
        return both
    if isinstance(first, Mapped) and isinstance(then, Mapped):
        before, after = dict(first.pairs), dict(then.pairs)
        sources = {**before, **after}
        if len(sources) > _MOST_PAIRS:
            raise InputError(f"mappings of more than {_MOST_PAIRS:,} values follow each other")
        passed = ((source, before.get(source, source)) for source in sources)
        return Mapped(tuple((source, after.get(value, value)) for source, value in passed))
    raise InputError("a linear transformation and a mapping of single values follow each other")


@dataclass(frozen=True)
class Unit:
    """A unit: a value in base units is factor * value + offset.

    Attributes:
        name: as connectors and variables write it.
        exponents: of :data:`BASE_UNITS`; None: nothing defines this unit.

    """

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0


class UndefinedUnit(InputError):
    """A value is to go from one unit to another, of which nothing defines one."""


#: Units by their names.
Units = Mapping[str, Unit]


def defined(component: Component, name: str) -> Unit:
    """A unit as an FMU defines it."""
    for unit in component.description.unitDefinitions:
        if unit.name == name and unit.baseUnit is not None:
            base: Any = unit.baseUnit
            exponents = tuple(int(getattr(base, of, 0) or 0) for of in BASE_UNITS)
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
    name = variable.unit
    if not name:
        return None
    unit = defined(component, name)
    if unit.exponents is None:
        unit = (otherwise or {}).get(name, unit)
    # A difference of two temperatures has no zero that could be shifted.
    return replace(unit, offset=0.0) if variable.is_relative else unit


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
