"""Connections of ports: names, units, and transformations of values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from sys import float_info
from typing import Any, ClassVar, TypeAlias

import numpy as np

from orchestrator.cosim.component import Component
from orchestrator.cosim.variables import BUS, COMPLETE, TYPES, Terminal, Variable
from orchestrator.machine.errors import InputError, listed


@dataclass(frozen=True)
class PortName:
    """A port of a component in a system."""

    component: str
    port: str

    def __str__(self) -> str:
        """`component.port`, as in files and on the command line."""
        return f"{self.component}.{self.port}"

    @classmethod
    def read(cls, text: str) -> PortName:
        """Split `component.port` at the first dot.

        A component's name may contain dots, too: only the system can tell which of them ends it
        (:meth:`.system.System.named`).

        Raises:
            InputError: there is no dot.

        """
        component, dot, port = text.partition(".")
        if not (component and dot and port):
            raise InputError(f"{text!r}: write COMPONENT.PORT or COMPONENT.PARAMETER")
        return cls(component, port)

    @staticmethod
    def splits(text: str) -> Iterator[tuple[str, str]]:
        """Yield the ways to split a name, the longest name of a component first."""
        dot = text.rfind(".")
        while dot >= 0:
            yield text[:dot], text[dot + 1 :]
            dot = text.rfind(".", 0, dot)


def likely_port(name: PortName, components: Collection[str]) -> PortName:
    """Split a name that begins with no component after the systems that it begins with."""
    outer, inner = name.component, name.port
    while "." in inner and any(component.startswith(f"{outer}.") for component in components):
        part, _, inner = inner.partition(".")
        outer = f"{outer}.{part}"
    return PortName(outer, inner)


#: Largest number of pairs of a combined mapping.
_MOST_PAIRS = 1000

#: Base units of FMI 2.0 and SSP 1.0, in the order of :attr:`Unit.exponents`.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class Linear:
    """The target takes factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0

    #: Factor and offset that change no number: times one, plus minus zero keeps minus zero, too.
    UNCHANGED: ClassVar[tuple[float, float]] = (1.0, -0.0)

    def __call__(self, value: float) -> float:
        """Return the value that arrives."""
        return self.factor * value + self.offset


@dataclass(frozen=True)
class Mapped:
    """The target takes the value that is listed for the source's; any other value stays as it is.

    Attributes:
        pairs: values of source and target; Booleans as zero and one, integers exact.

    """

    pairs: tuple[tuple[float, float], ...]

    def __call__(self, value: float) -> float:
        """Return the value that arrives."""
        return dict(self.pairs).get(value, value)


Transformation: TypeAlias = Linear | Mapped


def combine(first: Transformation | None, then: Transformation | None) -> Transformation | None:
    """Combine two successive transformations; None leaves a value as it is.

    Raises:
        InputError: one is linear and the other a mapping; the result is not a finite number; or the
            combined mapping is too long.

    """
    # An identity is kept only if there is nothing else.
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
        name: as in connectors and variables.
        exponents: of :data:`BASE_UNITS`; None: the unit is not defined.

    """

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0


class UndefinedUnit(InputError):
    """A conversion between two units, one of which is not defined."""


#: Units by their names.
Units = Mapping[str, Unit]


def defined(component: Component, name: str) -> Unit:
    """Return a unit as an FMU defines it."""
    for unit in component.description.unitDefinitions:
        if unit.name == name and unit.baseUnit is not None:
            base: Any = unit.baseUnit
            exponents = tuple(int(getattr(base, exponent, 0) or 0) for exponent in BASE_UNITS)
            return Unit(name, exponents, float(base.factor), float(base.offset))
    return Unit(name)


def unit_of_port(component: Component, port: str, otherwise: Units | None = None) -> Unit | None:
    """Return the unit of a variable, or None.

    Args:
        component: with the variable.
        port: name of the variable.
        otherwise: units that are defined elsewhere, for a unit that the FMU does not define.

    """
    variable = component.variable(port)
    name = variable.unit
    if not name:
        return None
    unit = defined(component, name)
    if unit.exponents is None:
        unit = (otherwise or {}).get(name, unit)
    # A difference of two temperatures has no zero to be shifted.
    return replace(unit, offset=0.0) if variable.is_relative else unit


def conversion(source: Unit | None, target: Unit | None) -> Linear | None:
    """Return the conversion from one unit to another; None: the value stays as it is.

    Raises:
        InputError: they measure different quantities.
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


#: Families of types that can feed another family.
_FED_FROM = {"Real": ("Integer",), "Integer": ("Enumeration",), "Enumeration": ("Integer",)}


@dataclass(frozen=True)
class Connection:
    """A value that goes from an output to an input.

    Attributes:
        source, target: its ends.
        transformation: of the value on its way; None: it arrives bit for bit, and both ends must
            have the same unit.

    """

    source: PortName
    target: PortName
    transformation: Transformation | None = None

    @classmethod
    def of_terminals(
        cls, to: Component, end: Terminal, start: Component, begin: Terminal
    ) -> Iterator[Connection]:
        """Connect two terminals by the rules of both: each input takes an output.

        Args:
            to, end: a component and its terminal.
            start, begin: the other ones.

        Raises:
            InputError: the terminals do not fit.

        """
        for terminal, partner in ((end, begin), (begin, end)):
            if terminal.rule not in (*COMPLETE, BUS):
                raise InputError(
                    f"the matching rule {terminal.rule!r} of a terminal is not supported"
                )
            if terminal.flows:
                raise InputError(
                    f"{listed(terminal.flows)} of a terminal: only signals are supported"
                )
            missing = [member for member in terminal.members if member not in partner.members]
            if terminal.rule in COMPLETE and missing:
                raise InputError(f"a terminal lacks the member {listed(missing)}")
        for member in (member for member in end.members if member in begin.members):
            targets, sources = (
                to.elements(end.members[member]),
                start.elements(begin.members[member]),
            )
            if len(targets) != len(sources):
                raise InputError(
                    f"{member} has {len(sources)} elements here and {len(targets)} there"
                )
            for target, source in zip(targets, sources, strict=True):
                there, here = PortName(start.name, source.name), PortName(to.name, target.name)
                match source.causality, target.causality:
                    case "output", "input":
                        yield cls(there, here)
                    case "input", "output":
                        yield cls(here, there)
                    case first, second:
                        raise InputError(f"{there} has causality {first}, {here} of {second}")


def check_connection(connection: Connection, component: Callable[[str], Component]) -> None:
    """Check that the ends of a connection exist and fit.

    Args:
        connection: of a system.
        component: returns a component of that system by its name.

    Raises:
        InputError: a port does not exist, or they do not fit.

    """
    source, target = connection.source, connection.target
    starts, ends = component(source.component), component(target.component)
    a, b = starts.variable(source.port), ends.variable(target.port)
    for end, variable, causality in ((source, a, "output"), (target, b, "input")):
        if variable.causality != causality:
            raise InputError(
                f"{source} -> {target}: {end} has causality {variable.causality}, not {causality}"
            )
    if not can_feed(a, b):
        raise InputError(f"{source} -> {target}: cannot feed {a.type} into {b.type}")
    if connection.transformation not in (None, Linear()):
        _check_transformed(connection, b.type)
    if connection.transformation is not None or a.unit == b.unit:
        return
    units = unit_of_port(starts, source.port), unit_of_port(ends, target.port)
    try:
        converted = conversion(*units)
    except InputError as error:
        raise InputError(f"{source} -> {target}: {error}") from None
    if converted is not None:
        names = " and ".join(unit.name for unit in units if unit)
        raise InputError(f"{source} -> {target}: units differ, {names}")


def can_feed(source: Variable, target: Variable) -> bool:
    """Return True if a variable takes all values of another one without loss."""
    start, end = TYPES[source.type], TYPES[target.type]
    if start.family not in (end.family, *_FED_FROM.get(end.family, ())):
        return False
    if (start.family, end.family) == ("Integer", "Real"):
        return bool(start.most < 2 ** np.finfo(np.dtype(end.c_type)).nmant)
    return end.least <= start.least and start.most <= end.most


def _check_transformed(connection: Connection, fmi_type: str) -> None:
    """Refuse to transform anything but numbers, and to make fractions of integers."""
    wire = f"{connection.source} -> {connection.target}"
    own = TYPES[fmi_type]
    is_real = own.family == "Real"
    match connection.transformation:
        case Linear(factor, offset):
            if not is_real:
                raise InputError(
                    f"{wire}: a value of type {fmi_type} cannot be transformed linearly"
                )
            if not (isfinite(factor) and isfinite(offset)):
                raise InputError(
                    f"{wire}: the factor {factor:g} or the offset {offset:g} is not finite"
                )
        case Mapped(pairs):
            if own.family == "String":
                raise InputError(f"{wire}: a {fmi_type} cannot be mapped")
            convert = float if is_real else int
            for _, value in pairs:
                if not own.least <= value <= own.most or value != convert(value):
                    shown = value if isinstance(value, int) else f"{value:.16g}"
                    raise InputError(
                        f"{wire}: is mapped to {shown}, which FMI type {fmi_type} cannot hold"
                    )
