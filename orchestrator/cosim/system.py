"""The system to simulate: components, connections, parameters; rings, orders and stages."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from fractions import Fraction
from functools import cached_property
from math import gcd, isfinite, lcm
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cosim.component import Component
from orchestrator.cosim.connection import (
    Connection,
    PortName,
    can_feed,
    check_connection,
    likely_port,
)
from orchestrator.cosim.experiment import MOST_STEPS, Experiment, Order
from orchestrator.cosim.variables import Value, Variable
from orchestrator.machine.disk import plain_file_names, process_folder
from orchestrator.machine.errors import InputError, did_you_mean, listed
from orchestrator.machine.texts import is_finite
from orchestrator.machine.user_files import read_archive

#: For each component, the components whose direct feedthrough feeds it.
Sources = Mapping[str, Collection[str]]


def without_rings(sources: Sources) -> dict[str, set[str]]:
    """Open all rings: in a ring, each component waits for the one before it."""
    place = {name: i for i, name in enumerate(sources)}
    opened_sources: dict[str, set[str]] = {}
    for part in strongly_connected(sources):
        before: set[str] = set()
        ring = set(part)
        for name in opened(part, sources, place):
            outer = {source for source in sources[name] if source not in ring}
            opened_sources[name] = outer | before
            before = {name}
    return {name: opened_sources[name] for name in sources}


def in_levels(sources: Sources, last: Collection[str]) -> list[str]:
    """Order the components of a graph without rings: first those that wait for nothing, and so on.

    Those in `last` come when all others are left that wait for them.
    """
    missing = {name: len(feeding) for name, feeding in sources.items()}
    fed: dict[str, list[str]] = {name: [] for name in sources}
    for name, feeding in sources.items():
        for source in feeding:
            fed[source].append(name)
    place = {name: i for i, name in enumerate(sources)}
    order: list[str] = []
    ready = [name for name, n in missing.items() if n == 0]
    later: list[str] = []
    while ready or later:
        level = [name for name in ready if name not in last]
        later += [name for name in ready if name in last]
        if not level:
            level, later = later, []
        level.sort(key=place.__getitem__)
        order += level
        ready = []
        for target in (target for name in level for target in fed[name]):
            missing[target] -= 1
            if missing[target] == 0:
                ready.append(target)
    return order


def opened(ring: Sequence[str], sources: Sources, place: Mapping[str, int]) -> list[str]:
    """Order the components of a ring as it is opened: the first, then the rest, part by part.

    The rest of a ring may contain rings again, and so on inwards. They are found from the innermost
    outwards: components are added to a graph, the last first, and each is merged with those that it
    closes a ring with. The time is proportional to the number of connections, except for rings that
    are constructed to be slow.
    """
    lead: dict[str, str] = {}
    feeding: dict[str, set[str]] = {}
    fed: dict[str, set[str]] = {}
    parts: dict[str, list[str]] = {}
    targets: dict[str, list[str]] = {name: [] for name in ring}
    for name in ring:
        for source in sources[name]:
            if source in targets:
                targets[source].append(name)

    def whole(name: str) -> str:
        while lead[name] != name:
            lead[name] = name = lead[lead[name]]
        return name

    for first in sorted(ring, key=place.__getitem__, reverse=True):
        feeding[first] = {whole(source) for source in sources[first] if source in lead}
        fed[first] = {whole(target) for target in targets[first] if target in lead}
        lead[first] = first
        inner = _closing(first, feeding, fed)
        waiting = {name: feeding[name] & inner for name in sorted(inner, key=place.__getitem__)}
        parts[first] = in_levels(waiting, ())
        for ends, others in ((feeding, fed), (fed, feeding)):
            ends[first] = ends[first].union(*(ends.pop(name) for name in inner)) - inner - {first}
            for name in ends[first]:
                others[name] = others[name] - inner | {first}
        lead |= dict.fromkeys(inner, first)
    order: list[str] = []
    ahead = [first]
    while ahead:
        order.append(ahead.pop())
        ahead += reversed(parts[order[-1]])
    return order


def _closing(first: str, feeding: Mapping[str, set[str]], fed: Mapping[str, set[str]]) -> set[str]:
    """Return the components that feed one, directly or not, and are fed by it.

    The search goes both ways at the same time, until one of them ends.
    """
    ways = (feeding, fed)
    reached: tuple[set[str], set[str]] = (set(), set())
    ahead = [[first], [first]]
    while all(ahead):
        for neighbours, known, waiting in zip(ways, reached, ahead, strict=True):
            new = neighbours[waiting.pop()] - known
            known |= new
            waiting += new
    done = 0 if not ahead[0] else 1
    within, neighbours = reached[done], ways[1 - done]
    closing: set[str] = set()
    waiting = [first]
    while waiting:
        new = (neighbours[waiting.pop()] & within) - closing
        closing |= new
        waiting += new
    return closing - {first}


def strongly_connected(sources: Sources) -> list[list[str]]:
    """Return the strongly connected parts of the graph (Tarjan 1972).

    Returns:
        The parts, each after those that it waits for.

    """
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    open_: dict[str, None] = {}
    parts: list[list[str]] = []
    for root in sources:
        if root in number:
            continue
        path: list[tuple[str, Iterator[str]]] = []
        following: str | None = root
        while following is not None or path:
            if following is not None:
                number[following] = lowest[following] = len(number)
                open_[following] = None
                path.append((following, iter(sources[following])))
            name, ahead = path[-1]
            following = None
            for source in ahead:
                if source not in number:
                    following = source
                    break
                if source in open_:
                    lowest[name] = min(lowest[name], number[source])
            if following is not None:
                continue
            path.pop()
            if path:
                above = path[-1][0]
                lowest[above] = min(lowest[above], lowest[name])
            if lowest[name] == number[name]:
                part: list[str] = []
                while not part or part[-1] != name:
                    last, _ = open_.popitem()
                    part.append(last)
                parts.append(part)
    return parts


#: Values by names of ports or of groups, as names or as texts.
Values = Mapping[PortName, object] | Mapping[str, object]

#: Stands for any text between two dots of a component's name.
STAR = "*"

#: Largest quotient of the smallest step and a common divisor of all steps.
_MOST_PARTS = 1000

#: Key of the FMUs in a pickled system.
_ARCHIVES = "archives"

#: Characters between the names of a group and of its members.
_MEMBER = (".", "[")


@dataclass(frozen=True)
class System:
    """Components, their connections, and the values of their parameters.

    Attributes:
        name: of the system.
        components: by name of instance.
        connections: in the order of their statement.
        parameters: values that differ from the components' own, in the variables' types.
        start_time, stop_time, step: of the experiment that the system asks for [s]; None: it does
            not ask.
        steps: of components with a step of their own [s].
        left_open: inputs that are open on purpose.

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

    def __getstate__(self) -> dict[str, Any]:
        """Return the state with the unchanged FMUs, each once, by their digests.

        Another machine has no such files, and those in our temporary folder end with this process.
        """
        archives: dict[str, bytes] = {}
        for part in self.components.values():
            if part.digest not in archives:
                with suppress(InputError):
                    archives[part.digest] = read_archive(part.fmu, part.digest)
        return {**self.__dict__, _ARCHIVES: (process_folder(), archives)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Write missing FMUs into the temporary folder of this process."""
        content = dict(state)
        temporary, archives = content.pop(_ARCHIVES)
        parts = content["components"]
        places = {
            part.fmu: _place(part.fmu, part.digest, archives[part.digest], temporary)
            for part in parts.values()
            if part.digest in archives
        }
        content["components"] = {
            name: replace(part, fmu=places.get(part.fmu, part.fmu)) for name, part in parts.items()
        }
        self.__dict__.update(content)

    def with_parameters(self, values: Values) -> System:
        """Return the system with further values, which replace its own.

        Args:
            values: by names of ports or of groups, as for :meth:`expanded`; texts are read like
                those of a command line.

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
            new[target] = self.variable(target).typed(value, str(target))
        return replace(self, parameters={**self.parameters, **new})

    def expanded(self, values: Values) -> dict[PortName, object]:
        """Return values by ports; a list for a group has a value for each member; the last wins.

        A star in a component's name stands for any text without a dot. A value that
        :meth:`is_spread` differs from component to component. Names without a star win.

        Raises:
            InputError: a name is not a port's, or the numbers of values and ports differ.

        """
        values_by_port: dict[PortName, object] = {}
        for key, values_of in sorted(values.items(), key=lambda item: STAR not in str(item[0])):
            stated = key if isinstance(key, PortName) else self._port_name(str(key))
            names = self.expand(stated)
            for name, value in zip(names, _spread(stated, values_of, len(names)), strict=True):
                several = None if self.has(name) else _several(value)
                ports = [] if several is None else self.members(str(name), ("parameter", "input"))
                values_by_port |= (
                    dict(self.paired(name, ports, several)) if several and ports else {name: value}
                )
        return values_by_port

    @staticmethod
    def paired(
        name: object, ports: Sequence[PortName], values: Sequence[Any]
    ) -> Iterator[tuple[PortName, Any]]:
        """Pair the ports of a group with their values.

        Raises:
            InputError: their numbers differ.

        """
        if len(values) != len(ports):
            raise InputError(f"{name}: takes {len(ports)} values, not {len(values)}")
        return zip(ports, values, strict=True)

    @staticmethod
    def is_spread(value: object) -> bool:
        """Return True for a value that lists what each of several components gets.

        `{"each": [1, 2, 4]}` lists the values, `{"first": 1, "step": 2}` counts from the first on.
        """
        return isinstance(value, Mapping) and value.keys() in ({"each"}, {"first", "step"})

    def expand(self, name: PortName) -> list[PortName]:
        """Return the ports or groups that match a name with stars, or else the name itself."""
        for like, port in PortName.splits(str(name)) if STAR in str(name) else ():
            starts = tuple(port + mark for mark in _MEMBER)
            names = [
                PortName(owner, port)
                for owner, component in self.components.items()
                if _is_like(owner, like)
                and any(v == port or v.startswith(starts) for v in component.variables)
            ]
            if names:
                return names
        return [name]

    def _port_name(self, text: str) -> PortName:
        """Read the name of a port; where it lacks a component, the error suggests some."""
        try:
            return PortName.read(text)
        except InputError as error:
            whole = (f"{name}.{text}" for name in self.components)
            having = [name for name in whole if self.has(PortName.read(name))]
            hint = f"; did you mean {' or '.join(having)}?" if having else ""
            raise InputError(f"{error}{hint}") from None

    def members(self, text: str, causalities: Sequence[str]) -> list[PortName]:
        """Return the ports of a group `component.group`, in their order; none: no such group."""
        for component, group in PortName.splits(text):
            if component in self.components:
                starts = tuple(group + mark for mark in _MEMBER)
                ports = [
                    PortName(component, variable.name)
                    for causality in causalities
                    for variable in self.components[component].having(causality)
                    if variable.name.startswith(starts)
                ]
                if ports:
                    return ports
        return []

    def named(self, name: PortName) -> PortName:
        """Return the port of a name; the component's name in it may contain dots, too.

        The longest component that the text begins with wins, if it has such a port; else the port
        that was likely meant. With a star, the first match is returned.
        """
        name, components, likely = self.expand(name)[0], self.components, None
        for component, port in PortName.splits(str(name)):
            if component in components:
                if port in components[component].variables:
                    return PortName(component, port)
                likely = likely or PortName(component, port)
        return likely or likely_port(name, components)

    def has(self, name: PortName) -> bool:
        """Return True if there is such a port or parameter."""
        target = self.named(name)
        component = self.components.get(target.component)
        return component is not None and target.port in component.variables

    def parameters_of(self, component: str) -> dict[str, Value]:
        """Return the values that this system sets in a component, by names of its variables."""
        return dict(self._parameters.get(component, {}))

    @cached_property
    def _parameters(self) -> dict[str, dict[str, Value]]:
        by_component: dict[str, dict[str, Value]] = {}
        for target, value in self.parameters.items():
            by_component.setdefault(target.component, {})[target.port] = value
        return by_component

    def changed(self, *types: str) -> dict[PortName, Value]:
        """Return parameters that differ from their FMUs' own values; of some types, or of all."""
        return {
            name: value
            for name, value in self.parameters.items()
            if value != (own := self.component(name.component)).start(name.port)
            and (not types or own.variable(name.port).family in types)
        }

    @cached_property
    def feeding(self) -> dict[str, list[Connection]]:
        """Connections that end at each component."""
        by_target: dict[str, list[Connection]] = {name: [] for name in self.components}
        for connection in self.connections:
            by_target.setdefault(connection.target.component, []).append(connection)
        return by_target

    @cached_property
    def fed(self) -> dict[str, list[Connection]]:
        """Connections that begin at each component."""
        by_source: dict[str, list[Connection]] = {name: [] for name in self.components}
        for connection in self.connections:
            by_source.setdefault(connection.source.component, []).append(connection)
        return by_source

    def fmus(self, *taken: str) -> dict[Path, str]:
        """Return all FMUs, each with a unique file name that is not taken."""
        fmus = sorted({component.fmu for component in self.components.values()})
        return dict(zip(fmus, plain_file_names((fmu.name for fmu in fmus), *taken), strict=True))

    def open_inputs(self, component: str) -> list[str]:
        """Return the inputs of a component that nothing feeds, and for which no value is set."""
        taken = {connection.target.port for connection in self.feeding[component]}
        taken |= self.parameters_of(component).keys()
        return [
            variable.name
            for variable in self.components[component].having("input")
            if variable.name not in taken
        ]

    def value(self, name: PortName) -> Value | None:
        """Return the value of a parameter: the one that is set, or else the component's own.

        Raises:
            InputError: there is no such parameter.

        """
        target = self.named(name)
        if target in self.parameters:
            return self.parameters[target]
        return self.component(target.component).start(target.port)

    def component(self, name: str) -> Component:
        """Return one component of the system.

        Raises:
            InputError: there is no such component.

        """
        if name not in self.components:
            raise InputError(
                f"the system has no component {name!r}; it has {listed([*self.components])}"
                f"{did_you_mean(name, self.components)}"
            )
        return self.components[name]

    def variable(self, port: PortName) -> Variable:
        """Return the variable of a port.

        Raises:
            InputError: there is no such component or port.

        """
        return self.component(port.component).variable(port.port)

    def columns(self, causalities: Sequence[str] = ("input", "output")) -> Iterator[PortName]:
        """Yield a table's columns: of each component the inputs, then the outputs, as declared.

        Args:
            causalities: of the ports.

        """
        for name, component in self.components.items():
            for causality in causalities:
                for variable in component.having(causality):
                    yield PortName(name, variable.name)

    def units(self, ports: Iterable[PortName]) -> dict[str, str]:
        """Return the units of the ports that have one."""
        units = {str(port): self.variable(port).unit for port in ports}
        return {name: unit for name, unit in units.items() if unit is not None}

    def check(self) -> None:
        """Check connections and parameters against the descriptions of the FMUs.

        Raises:
            InputError: a port does not exist, or two ports do not fit.

        """
        for problem in self.problems():
            raise InputError(problem)

    def check_order(self, order: Order | None) -> None:
        """Check that a stated order names each component once.

        Raises:
            InputError: it does not.

        """
        if order is None or isinstance(order, str):
            return
        for name in order:
            self.component(name)
        stated = Counter(order)
        twice = [name for name, n in stated.items() if n > 1]
        missing = [name for name in self.components if name not in stated]
        for names, what in ((twice, "twice"), (missing, "not at all")):
            if names:
                raise InputError(
                    f"order {','.join(order)}: names {', '.join(names)} {what}; it must name every "
                    "component once"
                )

    def problems(self) -> Iterator[str]:
        """Yield a line for every mistake in names, connections and parameters."""
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
        """Yield the names that two ports share, where one component's name begins another's."""
        for name, component in self.components.items():
            for outer, rest in PortName.splits(name):
                if outer in self.components:
                    others = self.components[outer].variables
                    for port in component.variables:
                        if f"{rest}.{port}" in others:
                            yield f"two ports are named {name}.{port}"

    def rings(self, among: Collection[str] | None = None) -> list[list[str]]:
        """Return rings of direct feedthroughs: components that wait for each other or themselves.

        Args:
            among: components to look at; None: all.

        Returns:
            Each ring in the order in which :meth:`derived_order` opens it.

        """
        sources = self._sources(among)
        place = {name: i for i, name in enumerate(sources)}
        return [
            opened(part, sources, place)
            for part in strongly_connected(sources)
            if len(part) > 1 or part[0] in sources[part[0]]
        ]

    def derived_order(self, solved: Sequence[Sequence[str]] = ()) -> list[str]:
        """Return all components, those with direct feedthrough before those that they feed.

        In a ring no order does that for every connection. Its first component in the system comes
        first, and takes one step late what feeds it; if the others still form a ring, it is opened
        in the same way: see :meth:`delayed_connections`.

        Args:
            solved: rings that are stepped as one component each. They come after everything that
                does not wait for them, so that they can be closed with the latest values that feed
                them.

        """
        ring_of = {name: ring for ring in solved for name in ring}
        # A ring has the place of its first component.
        place = {name: i for i, name in enumerate(self.components)}
        firsts = [(min(ring, key=place.__getitem__), ring) for ring in solved]
        lead = {name: first for first, ring in firsts for name in ring}
        sources: dict[str, set[str]] = {lead.get(name, name): set() for name in self.components}
        for name, feeding in self._sources().items():
            own = lead.get(name, name)
            sources[own] |= {lead.get(source, source) for source in feeding}
            if name in lead:
                sources[own].discard(own)
        order = in_levels(without_rings(sources), set(lead.values()))
        return [member for name in order for member in ring_of.get(name, (name,))]

    def delayed_connections(
        self, order: Sequence[str], solved: Iterable[Sequence[str]] = ()
    ) -> list[Connection]:
        """Return the connections with direct feedthrough that an order makes one step late.

        Args:
            order: all components, stepped one after the other.
            solved: rings that are stepped as one component each.

        """
        place = {name: i for i, name in enumerate(order)}
        ring_of = {name: i for i, ring in enumerate(solved) for name in ring}
        return [
            connection
            for connection in self.connections
            if self.has_feedthrough(connection)
            and place[source := connection.source.component]
            >= place[target := connection.target.component]
            and not (source in ring_of and ring_of[source] == ring_of.get(target))
        ]

    def in_stages(
        self, order: Sequence[str], solved: Sequence[Sequence[str]] = ()
    ) -> list[list[str]]:
        """Divide an order into stages, within which no component takes what another one computes.

        Solved rings have their own stages, each in the place of its first component.
        """
        ring_of = {name: ring for ring in map(list, solved) for name in ring}
        units: dict[str, list[str]] = {}
        for name in order:
            ring = ring_of.get(name, [name])
            units.setdefault(ring[0], ring)
        late = set(
            self.delayed_connections([name for unit in units.values() for name in unit], solved)
        )
        feeding: dict[str, set[str]] = {name: set() for name in order}
        for connection in self.connections:
            if self.has_feedthrough(connection) and connection not in late:
                feeding[connection.target.component].add(connection.source.component)
        stages: list[list[str]] = []
        stage_of: dict[str, int] = {}
        for first, unit in units.items():
            present = len(stages) - 1
            fits = stages and (first in ring_of) == (stages[-1][0] in ring_of)
            if not fits or any(stage_of.get(s) == present for name in unit for s in feeding[name]):
                stages.append([])
            stages[-1] += unit
            stage_of |= dict.fromkeys(unit, len(stages) - 1)
        return stages

    def has_feedthrough(self, connection: Connection) -> bool:
        """Return True if the source of a connection depends on an input of the same instant."""
        source = connection.source
        return self.components[source.component].has_feedthrough(source.port)

    def _sources(self, among: Collection[str] | None = None) -> dict[str, set[str]]:
        counted = (name for name in self.components if among is None or name in among)
        sources: dict[str, set[str]] = {name: set() for name in counted}
        for connection in self.connections:
            source, target = connection.source.component, connection.target.component
            if source in sources and target in sources and self.has_feedthrough(connection):
                sources[target].add(source)
        return sources

    def reaching(self, component: str, until: set[str]) -> Iterator[Connection]:
        """Yield the connections through which values reach a component, directly or through others.

        Args:
            component: where the values arrive.
            until: components where the search ends.

        """
        seen, waiting = {component}, [component]
        while waiting:
            for connection in self.feeding[waiting.pop()]:
                yield connection
                source = connection.source.component
                if source not in seen | until:
                    seen.add(source)
                    waiting.append(source)

    def unfed_inputs(self, settled: Collection[PortName] = ()) -> str | None:
        """Describe the inputs that nothing feeds or sets, with wires that could feed them.

        Args:
            settled: inputs that are set during a run.

        Returns:
            One line; None: all inputs are fed or set.

        """
        fed = {connection.target for connection in self.connections}
        feeding = {
            (connection.source.component, connection.target.port) for connection in self.connections
        }
        taken = {*fed, *self.parameters, *self.left_open, *settled}
        labels: list[str] = []
        wires: list[str] = []
        giving: dict[str, list[str]] = {}
        for name, component in self.components.items():
            for output in component.having("output"):
                giving.setdefault(output.name, []).append(name)
        for name, component in self.components.items():
            groups: dict[str, list[Variable]] = {}
            for variable in component.having("input"):
                groups.setdefault(variable.name.rpartition(".")[0], []).append(variable)
            for group, members in groups.items():
                unfed = [v for v in members if PortName(name, v.name) not in taken]
                if not group or len(unfed) < len(members):
                    labels += [f"{name}.{variable.name}" for variable in unfed]
                    continue
                labels.append(f"{name}.{group}.*")
                # A source of the same inputs of another component belongs to that one.
                sources = (
                    other
                    for other in giving.get(members[0].name, ())
                    if other != name
                    and all(_could_feed(self.components[other], variable) for variable in members)
                    and not any((other, variable.name) in feeding for variable in members)
                )
                first, second = next(sources, None), next(sources, None)
                if first is not None and second is None:
                    wires.append(f'"{name}.{group}" = "{first}.{group}"')
        if not labels:
            return None
        hint = f"; wire {listed(wires)}" if wires else ""
        return f"nothing feeds or sets {listed(labels)}{hint}"

    def decimations(self, step: float) -> dict[str, int]:
        """Return the number of communication steps in one step of each component.

        Args:
            step: communication step [s].

        Raises:
            InputError: a component's step is not a multiple of it.

        """
        decimations = dict.fromkeys(self.components, 1)
        for name, own in self.steps.items():
            self.component(name)
            number = isinstance(own, Real) and not isinstance(own, bool)
            if not (number and isfinite(own) and own > 0.0):
                raise InputError(f"step of {name} {own!r}: must be a positive number of seconds")
            n = max(round(min(own / step, MOST_STEPS + 1.0)), 1)
            if abs(own / step - n) > Experiment.ROUNDING * n:
                raise InputError(
                    f"{name} needs steps of {own:g} s, which are not a multiple of the "
                    f"communication step of {step:g} s"
                )
            decimations[name] = n
        return decimations

    def with_common_step(self) -> System:
        """Return the system with the longest step that divides the steps of all components.

        A component's step is stated by the system, or else by its FMU. Without any, the system has
        none.

        Raises:
            InputError: they have no common divisor.

        """
        own = {name: component.step for name, component in self.components.items()}
        steps = {name: step for name, step in own.items() if step is not None} | dict(self.steps)
        if not steps:
            return self
        return replace(self, steps=steps, step=_common_measure(steps.values()))

    def flattened(self) -> System:
        """Return the system for tools without nested systems: `one.part` becomes `one_part`."""
        taken = {name for name in self.components if "." not in name}
        names = {}
        for name in self.components:
            if "." in name:
                plain = name.replace(".", "_")
                while plain in taken:
                    plain += "_"
                names[name] = plain
                taken.add(plain)
        return self.renamed(names) if names else self

    def renamed(self, names: Mapping[str, str]) -> System:
        """Return the system with other, unique names for some components."""

        def name_of(component: str) -> str:
            return names.get(component, component)

        def port_of(port: PortName) -> PortName:
            return PortName(name_of(port.component), port.port)

        return replace(
            self,
            components={
                name_of(name): replace(component, name=name_of(name))
                for name, component in self.components.items()
            },
            connections=tuple(
                replace(wire, source=port_of(wire.source), target=port_of(wire.target))
                for wire in self.connections
            ),
            parameters={port_of(port): value for port, value in self.parameters.items()},
            steps={name_of(name): step for name, step in self.steps.items()},
            left_open={port_of(port) for port in self.left_open},
        )


def _place(fmu: Path, digest: str, content: bytes, temporary: Path) -> Path:
    """Return the path of an FMU that another process has read, which is written if need be.

    Args:
        fmu: its path there.
        digest: of its content.
        content: of the file.
        temporary: folder that ends with the other process.

    """
    own = process_folder()
    if temporary == own or temporary not in fmu.parents:
        with suppress(InputError):
            read_archive(fmu, digest)
            return fmu
    path = own / digest / fmu.name
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
    return path


def _could_feed(source: Component, variable: Variable) -> bool:
    """Return True if a component has an output of the name and type of an input."""
    output = source.variables.get(variable.name)
    return output is not None and output.causality == "output" and can_feed(output, variable)


def _common_measure(steps: Iterable[float]) -> float:
    """Return the longest step that divides all steps [s], which count as they are written."""
    exact = [Fraction(str(step)) for step in steps]
    denominator = lcm(*(step.denominator for step in exact))
    common = Fraction(gcd(*(int(step * denominator) for step in exact)), denominator)
    if min(exact) > _MOST_PARTS * common:
        listed = ", ".join(f"{float(step):g}" for step in sorted(set(exact)))
        raise InputError(
            f"the components need steps of {listed} s, which have no common divisor; give a "
            "communication step that divides all of them"
        )
    return float(common)


def _spread(name: PortName, value: Any, n: int) -> list[Any]:
    """Return the value of each of n components.

    Raises:
        InputError: the number of values is another one.

    """
    if not System.is_spread(value):
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
    """Return True if a component's name matches a pattern; stars stand for text without dots."""
    # Only stars are wildcards. fnmatch takes no longer for more of them.
    parts, patterns = name.split("."), re.sub(r"[?[]", r"[\g<0>]", pattern).split(".")
    return len(parts) == len(patterns) and all(map(fnmatchcase, parts, patterns))


def _several(value: object) -> list[Any] | None:
    """Split a list, which a command line writes with commas; None: it is one value."""
    if isinstance(value, str):
        return value.strip().strip("[]").split(",") if "," in value else None
    if isinstance(value, np.ndarray):
        # An array without dimensions is one value.
        return list(value) if value.ndim else None
    return list(value) if isinstance(value, list | tuple) else None
