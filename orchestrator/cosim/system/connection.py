"""A connection of two ports: what goes from one to the other, and whether they fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isfinite

import numpy as np

from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.units import Linear, Mapped, Transformation, conversion, unit_of_port
from orchestrator.cosim.system.values import TYPES
from orchestrator.cosim.system.variables import BUS, COMPLETE, Terminal, Variable
from orchestrator.machine.errors import InputError, listed

#: What can be fed from another family of types, besides from its own.
_FED_FROM = {"Real": ("Integer",), "Integer": ("Enumeration",), "Enumeration": ("Integer",)}


@dataclass(frozen=True)
class Connection:
    """One value that goes from an output to an input.

    Attributes:
        source, target: its ends.
        transformation: what happens to the value on its way; None: it arrives bit for bit, and the
            units of its ends must be the same.

    """

    source: PortName
    target: PortName
    transformation: Transformation | None = None


def check_connection(connection: Connection, component: Callable[[str], Component]) -> None:
    """Check that the ends of a connection exist, and fit.

    Args:
        connection: of a system.
        component: of that system, by its name.

    Raises:
        InputError: a port does not exist, or they do not fit.

    """
    source, target = connection.source, connection.target
    starts, ends = component(source.component), component(target.component)
    a, b = starts.variable(source.port), ends.variable(target.port)
    for end, variable, wanted in ((source, a, "output"), (target, b, "input")):
        if variable.causality != wanted:
            raise InputError(
                f"{source} -> {target}: {end} has causality {variable.causality}, not {wanted}"
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
    """Whether a variable takes all values of another, and none is lost on the way."""
    start, end = TYPES[source.type], TYPES[target.type]
    if start.family not in (end.family, *_FED_FROM.get(end.family, ())):
        return False
    if (start.family, end.family) == ("Integer", "Real"):
        return bool(start.most < 2 ** np.finfo(np.dtype(end.c_type)).nmant)
    return end.least <= start.least and start.most <= end.most


def _check_transformed(connection: Connection, fmi_type: str) -> None:
    """Refuse to compute with anything but numbers, and to make fractions of whole ones."""
    wire = f"{connection.source} -> {connection.target}"
    of = TYPES[fmi_type]
    is_real = of.family == "Real"
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
            if of.family == "String":
                raise InputError(f"{wire}: a {fmi_type} cannot be mapped")
            for _, value in pairs:
                if not of.least <= value <= of.most or value != (float if is_real else int)(value):
                    shown = value if isinstance(value, int) else f"{value:.16g}"
                    raise InputError(
                        f"{wire}: is mapped to {shown}, which FMI type {fmi_type} cannot hold"
                    )


def join_terminals(
    to: Component, end: Terminal, start: Component, begin: Terminal
) -> Iterator[Connection]:
    """The connections of two terminals, by the rules of both: each input takes an output."""
    for one, other in ((end, begin), (begin, end)):
        if one.rule not in (*COMPLETE, BUS):
            raise InputError(f"the matching rule {one.rule!r} of a terminal is not supported")
        if one.flows:
            raise InputError(f"{listed(one.flows)} of a terminal: only signals are supported")
        missing = [member for member in one.members if member not in other.members]
        if one.rule in COMPLETE and missing:
            raise InputError(f"a terminal lacks the member {listed(missing)}")
    for member in (member for member in end.members if member in begin.members):
        targets, sources = to.elements(end.members[member]), start.elements(begin.members[member])
        if len(targets) != len(sources):
            raise InputError(f"{member} has {len(sources)} elements here and {len(targets)} there")
        for target, source in zip(targets, sources, strict=True):
            there, here = PortName(start.name, source.name), PortName(to.name, target.name)
            match source.causality, target.causality:
                case "output", "input":
                    yield Connection(there, here)
                case "input", "output":
                    yield Connection(here, there)
                case first, second:
                    raise InputError(f"{there} has causality {first}, {here} of {second}")
