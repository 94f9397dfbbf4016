"""The system that is simulated: components, connections and parameters, as an SSP holds them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.connection import Connection, check_connection
from orchestrator.cosim.system.names import (
    PortName,
    likely_port,
    listed,
    paired,
    plain_file_names,
    port_name,
    splits,
)  # fmt: skip
from orchestrator.cosim.system.values import Value, is_finite
from orchestrator.machine.errors import InputError, did_you_mean

#: Values by the names of ports or of groups, taken apart or as text.
Values = Mapping[PortName, object] | Mapping[str, object]

#: Stands for any part of a component's name, between two dots.
STAR = "*"

#: What is between the names of a group and of its members.
_MEMBER = (".", "[")


@dataclass(frozen=True)
class System:
    """Components, how they are connected, and the values of their parameters.

    Attributes:
        name: of the system.
        components: by the names of their instances.
        connections: in the order in which they were stated.
        parameters: values that differ from the components' own, in the variables' types.
        start_time, stop_time, step: the experiment that the system asks for [s]; None: it names
            none.
        steps: of components that ask for one of their own [s].
        left_open: inputs that are meant to have no source.

    """

    name: str
    components: Mapping[str, Component]
    connections: tuple[Connection, ...]
    parameters: Mapping[PortName, Value] = field(default_factory=dict)
    stop_time: float | None = None
    step: float | None = None
    start_time: float | None = None
    steps: Mapping[str, float] = field(default_factory=dict)
    left_open: Collection[PortName] = frozenset()

    def __repr__(self) -> str:
        """One line: a system's descriptions are long."""
        return f"<System {self.name}: {', '.join(self.components)}>"

    def with_parameters(self, values: Values) -> System:
        """The same system with further values, which win over its own.

        Args:
            values: by the names of their ports, or of groups, as for :meth:`expanded`; text is
                read as the command line reads it.

        Raises:
            InputError: there is no such port, or the value is not of its type or out of range.

        """
        new = {}
        for name, value in self.expanded(values).items():
            target = self.named(name)
            ports = [] if self.has(name) else self.members(str(name), ("parameter", "input"))
            if ports:
                members = listed([str(port) for port in ports])
                raise InputError(f"{name}: takes a list of {len(ports)} values, for {members}")
            variable = self.component(target.component).variable(target.port)
            new[target] = variable.typed(value, str(target))
        return replace(self, parameters={**self.parameters, **new})

    def expanded(self, values: Values) -> dict[PortName, object]:
        """Values by ports only: a list for a group has a value for each member. The last one wins.

        A star in a component's name stands for any text without a dot. A value that
        :func:`is_spread` differs from component to component. Names without a star win.

        Raises:
            InputError: a name is not one of a port, or there are not as many values as ports.

        """
        found: dict[PortName, object] = {}
        for said, values_of in sorted(values.items(), key=lambda one: STAR not in str(one[0])):
            stated = said if isinstance(said, PortName) else self._port_name(str(said))
            meant = self.meant(stated)
            for name, value in zip(meant, _spread(stated, values_of, len(meant)), strict=True):
                several = None if self.has(name) else _several(value)
                ports = [] if several is None else self.members(str(name), ("parameter", "input"))
                found |= dict(paired(name, ports, several)) if several and ports else {name: value}
        return found

    def meant(self, name: PortName) -> list[PortName]:
        """The ports or groups that a name with stars means; any other name means itself."""
        for like, port in splits(str(name)) if STAR in str(name) else ():
            starts = tuple(port + mark for mark in _MEMBER)
            found = [
                PortName(one, port)
                for one, component in self.components.items()
                if _is_like(one, like)
                and any(v == port or v.startswith(starts) for v in component.variables)
            ]
            if found:
                return found
        return [name]

    def _port_name(self, text: str) -> PortName:
        """The name of a port; where it lacks a component, the message says which ones have it."""
        try:
            return port_name(text)
        except InputError as error:
            whole = (f"{name}.{text}" for name in self.components)
            having = [name for name in whole if self.has(port_name(name))]
            hint = f"; did you mean {' or '.join(having)}?" if having else ""
            raise InputError(f"{error}{hint}") from None

    def members(self, text: str, causalities: Sequence[str]) -> list[PortName]:
        """The ports of a group `component.group`, in their order; none: there is no such group."""
        for component, group in splits(text):
            if component in self.components:
                starts = tuple(group + mark for mark in _MEMBER)
                found = [
                    PortName(component, variable.name)
                    for causality in causalities
                    for variable in self.components[component].having(causality)
                    if variable.name.startswith(starts)
                ]
                if found:
                    return found
        return []

    def named(self, name: PortName) -> PortName:
        """The port that a name means, which may have dots in its component's name as well.

        It is one of the longest component that the text begins with and that has such a port, else
        of the one that was likely meant. With a star, it is the first of those it means.
        """
        name, components, likely = self.meant(name)[0], self.components, None
        for component, port in splits(str(name)):
            if component in components:
                if port in components[component].variables:
                    return PortName(component, port)
                likely = likely or PortName(component, port)
        return likely or likely_port(name, components)

    def has(self, name: PortName) -> bool:
        """Whether there is such a port or parameter."""
        target = self.named(name)
        component = self.components.get(target.component)
        return component is not None and target.port in component.variables

    def parameters_of(self, component: str) -> dict[str, Value]:
        """Values that this system sets in one component, by the names of its variables."""
        return dict(self._parameters.get(component, {}))

    @cached_property
    def _parameters(self) -> dict[str, dict[str, Value]]:
        found: dict[str, dict[str, Value]] = {}
        for target, value in self.parameters.items():
            found.setdefault(target.component, {})[target.port] = value
        return found

    def changed(self, *types: str) -> dict[PortName, Value]:
        """Parameters that differ from what their FMUs have themselves; of some types, or of all."""
        return {
            name: value
            for name, value in self.parameters.items()
            if value != (own := self.component(name.component)).start(name.port)
            and (not types or own.variable(name.port).family in types)
        }

    @cached_property
    def feeding(self) -> dict[str, list[Connection]]:
        """The connections that end at each component."""
        found: dict[str, list[Connection]] = {name: [] for name in self.components}
        for connection in self.connections:
            found.setdefault(connection.target.component, []).append(connection)
        return found

    @cached_property
    def fed(self) -> dict[str, list[Connection]]:
        """The connections that begin at each component."""
        found: dict[str, list[Connection]] = {name: [] for name in self.components}
        for connection in self.connections:
            found.setdefault(connection.source.component, []).append(connection)
        return found

    def fmus(self, *taken: str) -> dict[Path, str]:
        """All FMUs, each with a file name that no other has, nor any file that is taken."""
        fmus = sorted({component.fmu for component in self.components.values()})
        return dict(zip(fmus, plain_file_names((fmu.name for fmu in fmus), *taken), strict=True))

    def open_inputs(self, component: str) -> list[str]:
        """Inputs of one component that nothing feeds, and for which no value is set."""
        taken = {connection.target.port for connection in self.feeding[component]}
        taken |= self.parameters_of(component).keys()
        return [
            variable.name
            for variable in self.components[component].having("input")
            if variable.name not in taken
        ]

    def value(self, name: PortName) -> Value | None:
        """The value of a parameter: the one that is set, or else the component's own.

        Raises:
            InputError: there is no such parameter.

        """
        target = self.named(name)
        if target in self.parameters:
            return self.parameters[target]
        return self.component(target.component).start(target.port)

    def component(self, name: str) -> Component:
        """One component of the system.

        Raises:
            InputError: there is no such component.

        """
        if name not in self.components:
            raise InputError(
                f"the system has no component {name!r}; it has {listed([*self.components])}"
                f"{did_you_mean(name, self.components)}"
            )
        return self.components[name]

    def check(self) -> None:
        """Check connections and parameters against the descriptions of the FMUs.

        Raises:
            InputError: a port does not exist, or two ports do not fit.

        """
        for problem in self.problems():
            raise InputError(problem)

    def problems(self) -> Iterator[str]:
        """All that is wrong with names, connections and parameters, a line each."""
        yield from self._ambiguous()
        fed: dict[PortName, PortName] = {}
        for connection in self.connections:
            try:
                check_connection(connection, self.component)
            except InputError as error:
                yield str(error)
            source, target = connection.source, connection.target
            if target in fed:
                yield (
                    f"{target} is fed by {fed[target]} and by {source}; an input takes one "
                    "connection"
                )
            fed.setdefault(target, source)
        for target in self.parameters:
            try:
                component = self.component(target.component)
                causality = component.variable(target.port).causality
                settable = component.is_settable(target.port)
            except InputError as error:
                yield str(error)
                continue
            if target in fed:
                yield f"{target} is fed by {fed[target]} and cannot be set"
            if not settable:
                yield f"{target} has causality {causality} and cannot be set"

    def _ambiguous(self) -> Iterator[str]:
        """Names that two ports share, when one component's name begins another's."""
        for name, component in self.components.items():
            for outer, rest in splits(name):
                if outer in self.components:
                    others = self.components[outer].variables
                    for port in component.variables:
                        if f"{rest}.{port}" in others:
                            yield f"two ports are named {name}.{port}"


def renamed(system: System, names: Mapping[str, str]) -> System:
    """The same system with other names for some components, which are all different."""

    def name_of(component: str) -> str:
        return names.get(component, component)

    def port_of(port: PortName) -> PortName:
        return PortName(name_of(port.component), port.port)

    return replace(
        system,
        components={
            name_of(name): replace(component, name=name_of(name))
            for name, component in system.components.items()
        },
        connections=tuple(
            replace(wire, source=port_of(wire.source), target=port_of(wire.target))
            for wire in system.connections
        ),
        parameters={port_of(port): value for port, value in system.parameters.items()},
        steps={name_of(name): step for name, step in system.steps.items()},
        left_open={port_of(port) for port in system.left_open},
    )


def flattened(system: System) -> System:
    """The same system for tools that know no systems in systems: `one.part` is `one_part`."""
    taken = {name for name in system.components if "." not in name}
    names = {}
    for name in system.components:
        if "." in name:
            plain = name.replace(".", "_")
            while plain in taken:
                plain += "_"
            names[name] = plain
            taken.add(plain)
    return renamed(system, names) if names else system


def is_spread(value: object) -> bool:
    """Whether a value says what each of several components gets.

    `{"each": [1, 2, 4]}` lists the values, `{"first": 1, "step": 2}` counts from the first on.
    """
    return isinstance(value, Mapping) and value.keys() in ({"each"}, {"first", "step"})


def _spread(name: PortName, value: Any, n: int) -> list[Any]:
    """The value of each of n components.

    Raises:
        InputError: there are more or fewer of them.

    """
    if not is_spread(value):
        return [value] * n
    if "each" in value:
        if not isinstance(value["each"], list) or len(value["each"]) != n:
            raise InputError(f"{name}: each takes a list of {n} values, one for each component")
        return list(value["each"])
    first, step = value["first"], value["step"]
    if not (is_finite(first) and is_finite(step)):
        raise InputError(f"{name}: first and step must be finite numbers")
    return [first + step * k for k in range(n)]


def _is_like(name: str, pattern: str) -> bool:
    """Whether a component's name fits a pattern, whose stars stand for text without dots."""
    # Only stars are wildcards here. Those of fnmatch take no time that grows with their number.
    parts, patterns = name.split("."), re.sub(r"[?[]", r"[\g<0>]", pattern).split(".")
    return len(parts) == len(patterns) and all(map(fnmatchcase, parts, patterns))


def _several(value: object) -> list[Any] | None:
    """The values of a list, which a command line writes with commas; None: it is one value."""
    if isinstance(value, str):
        return value.strip().strip("[]").split(",") if "," in value else None
    if isinstance(value, np.ndarray):
        # An array without dimensions is one value.
        return list(value) if value.ndim else None
    return list(value) if isinstance(value, list | tuple) else None
