"""What a scenario says of events, read for a system: names, groups, values and their types."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

from orchestrator.cosim.hooks.events import (
    COMPARISONS,
    Action,
    Alter,
    Condition,
    Event,
    Freeze,
    Release,
    Reset,
    Set,
    Stop,
)
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName, flatten, paired, port_name
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.units import Linear, Mapped
from orchestrator.cosim.system.values import (
    TYPES,
    Value,
    finite,
    is_finite,
    literal,
    type_of,
    typed,
)
from orchestrator.machine.errors import Findings, InputError

_CONDITION = re.compile(rf"(\S+)\s*({'|'.join(COMPARISONS)})\s*(\S+)")


def read_events(
    where: object,
    tables: Sequence[Mapping[str, Any]],
    system: System,
    followed: Collection[PortName] = (),
) -> tuple[Event, ...]:
    """The events of a run.

    Args:
        where: they are written, for messages.
        tables: as :func:`.scenario.check_events` has found them good.
        system: that they happen to.
        followed: its inputs that follow a table.

    Raises:
        InputError: an event cannot happen to this system.

    """
    findings, events = Findings(), []
    for number, table in enumerate(tables, start=1):
        try:
            events.append(_event(table, system, followed))
        except InputError as error:
            findings.problem(f"{where}: event {number}: {error}")
    findings.refuse()
    return tuple(events)


def shared_events(
    tables: Sequence[Mapping[str, Any]], system: System
) -> tuple[Mapping[str, Any], ...]:
    """The events of a scenario that can happen to another system as well."""

    def can_happen(table: Mapping[str, Any]) -> bool:
        try:
            _event(table, system, ())
        except InputError:
            return False
        return True

    return tuple(filter(can_happen, tables))


def _event(table: Mapping[str, Any], system: System, followed: Collection[PortName]) -> Event:
    [key] = [key for key in table if key in ACTIONS]
    start = system.start_time or 0.0
    if table.get("at", start) < start:
        raise InputError(f"at = {table['at']}: before the run begins, at {start:g} s")
    text = "stop" if key == "stop" else f"{key} {', '.join(_things(table[key]))}"
    action = ACTIONS[key](table[key], system)
    for port, _ in action.inputs if isinstance(action, Set) else ():
        if port in followed:
            raise InputError(f"{port} follows a table of inputs: override it")
    return Event(
        text,
        action,
        table.get("label", text),
        table.get("at"),
        _condition(table["when"], system) if "when" in table else None,
        table.get("repeat", False),
        table.get("for"),
    )


def _things(value: Any) -> Iterator[str]:
    """What an event acts on, in words."""
    if isinstance(value, Mapping):
        yield from (f"{name} = {_shown(one)}" for name, one in flatten(value))
    else:
        yield from [value] if isinstance(value, str) else value


def _shown(value: Any) -> str:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value:g}" if is_number else literal(value)


def _condition(text: str, system: System) -> Condition:
    match = _CONDITION.fullmatch(text.strip())
    if match is None:
        raise InputError(
            f'when = {text!r}: write a signal, < or >, and a number: "plant.eta.z > 5"'
        )
    name, comparison, number = match.groups()
    [signal] = _ports(system, name, ("input", "output"), single=True)
    try:
        return Condition(signal, comparison, finite(number, f"when = {text!r}:"))
    except ValueError as error:
        raise InputError(str(error)) from None


# What there is in a system


def _ports(
    system: System, text: str, causalities: Sequence[str], single: bool = False
) -> list[PortName]:
    """The port of a name, or the ports of a group; of all components that a name with stars means.

    Args:
        system: that has them.
        text: `component.port` or `component.group`.
        causalities: that they may have.
        single: whether a port is wanted, and no group.

    Raises:
        InputError: there is none.

    """
    several = system.meant(port_name(text))
    if len(several) > 1:
        if single:
            raise InputError(f"{text} are {len(several)} signals; name one of them")
        return [port for one in several for port in _ports(system, str(one), causalities)]
    port = system.named(several[0])
    if not system.has(port) and not single and (members := system.members(text, causalities)):
        return members
    variable = system.component(port.component).variable(port.port)
    if variable.causality not in causalities:
        raise InputError(
            f"{port} has causality {variable.causality}, not {' or '.join(causalities)}"
        )
    if type_of(variable) == "String" and "parameter" not in causalities:
        raise InputError(f"{port} is a String: events act only on numbers and Booleans")
    return [port]


def _routes(system: System, port: PortName) -> list[Connection | None]:
    """The connections along which a signal reaches inputs; None: it is an input itself."""
    if system.component(port.component).variable(port.port).causality == "input":
        return [None]
    found: list[Connection | None] = [c for c in system.connections if c.source == port]
    if not found:
        raise InputError(f"{port} feeds nothing here: an event would change nothing")
    return found


def _inputs(names: Any, system: System) -> tuple[PortName, ...]:
    """The inputs that some signals reach."""
    return tuple(
        route.target if route else port
        for name in _things(names)
        for port in _ports(system, name, ("input", "output"))
        for route in _routes(system, port)
    )


def _members(name: str, value: Any, ports: Sequence[PortName]) -> Iterator[tuple[PortName, Any]]:
    """Ports of a group with their values: one for all, or a list with one for each."""
    return paired(name, ports, value if isinstance(value, list) else [value] * len(ports))


# What events do


def _altered(
    values: Mapping[str, Any],
    system: System,
    arriving: Callable[[System, PortName, Connection | None, Any], Value],
) -> tuple[tuple[PortName, Value], ...]:
    """The inputs that some signals reach, with what arrives there of their values."""
    return tuple(
        (route.target if route else port, arriving(system, port, route, one))
        for name, value in flatten(values)
        for port, one in _members(name, value, _ports(system, name, ("input", "output")))
        for route in _routes(system, port)
    )


def _value(system: System, port: PortName, route: Connection | None, value: Any) -> Value:
    """What an input takes where a signal is overridden."""
    variable = system.component(port.component).variable(port.port)
    found = typed(str(port), variable, _text(value))
    match route:
        case Connection(transformation=Linear() as change):
            return _arrived(port, route, value, change(float(found)))
        case Connection(transformation=Mapped(pairs)):
            assert not isinstance(found, str)
            return dict(pairs).get(found, found)
    return found


def _offset(system: System, port: PortName, route: Connection | None, value: Any) -> float:
    """What is added to an input where a signal is biased."""
    variable = system.component(port.component).variable(port.port)
    of = TYPES[variable.type]
    if of.family not in ("Real", "Integer") or of.is_wide:
        raise InputError(f"{port} is of type {variable.type}: nothing can be added to it")
    if not is_finite(value) or (
        of.family == "Integer" and (value != int(value) or abs(value) > of.most - of.least)
    ):
        raise InputError(f"{port}: {value!r} cannot be added to it")
    match route:
        case Connection(transformation=Linear(factor, _)):
            return _arrived(port, route, value, factor * float(value))
        case Connection(transformation=Mapped()):
            raise InputError(f"{port} is mapped by its connection: nothing can be added to it")
    return float(value)


def _arrived(port: PortName, route: Connection, value: Any, arriving: float) -> float:
    """What a value of an event is at the end of its way, where it must be a number still."""
    if not isfinite(arriving):
        raise InputError(f"{port}: {value!r} is {arriving:g} where it arrives, at {route.target}")
    return arriving


def _text(value: Any) -> Any:
    return literal(value) if isinstance(value, bool) else value


def _set(values: Mapping[str, Any], system: System) -> Action:
    fed = {connection.target: connection.source for connection in system.connections}
    parameters, inputs = [], []
    for name, value in flatten(values):
        for port, one in _members(name, value, _ports(system, name, ("parameter", "input"))):
            variable = system.component(port.component).variable(port.port)
            if port in fed:
                raise InputError(f"{port} is fed by {fed[port]}: override it")
            if variable.causality == "input":
                inputs.append((port, typed(str(port), variable, _text(one))))
            elif variable.variability != "tunable":
                raise InputError(
                    f"{port} is a {variable.variability} parameter: it cannot change during a run"
                )
            else:
                parameters.append((port, typed(str(port), variable, _text(one))))
    return Set(tuple(parameters), tuple(inputs))


def _reset(names: Any, system: System) -> Action:
    for name in _things(names):
        if system.steps.get(system.component(name).name, system.step) != system.step:
            raise InputError(f"{name} takes longer steps: it cannot be reset within one")
    return Reset(tuple(_things(names)))


#: What an event can do, by the key of its table.
ACTIONS: Mapping[str, Callable[[Any, System], Action]] = {
    "set": _set,
    "override": lambda values, system: Alter("override", _altered(values, system, _value)),
    "bias": lambda values, system: Alter("bias", _altered(values, system, _offset)),
    "freeze": lambda names, system: Freeze(_inputs(names, system)),
    "drop": lambda names, system: Freeze(_inputs(names, system)),
    "lose": lambda names, system: Alter(
        "override", _altered(dict.fromkeys(_things(names), 0), system, _value)
    ),
    "release": lambda names, system: Release(_inputs(names, system)),
    "reset": _reset,
    "stop": lambda _, __: Stop("stop"),
}
