"""The graph of a system: what depends on what, the order of stepping, and what nothing feeds."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.connection import Connection, can_feed
from orchestrator.cosim.system.names import PortName, listed
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.variables import Variable

#: What each component waits for: the components whose direct feedthrough feeds it.
_Sources = Mapping[str, Collection[str]]


def has_feedthrough(system: System, connection: Connection) -> bool:
    """Whether the source of a connection depends on an input of the same instant."""
    source = connection.source
    return system.components[source.component].has_feedthrough(source.port)


def rings(system: System, among: Collection[str] | None = None) -> list[list[str]]:
    """The rings of direct feedthroughs: components of which each waits for all others, or itself.

    Args:
        system: whose connections are looked at.
        among: components that count; None: all.

    Returns:
        Each ring in the order in which :func:`derived_order` opens it.

    """
    sources = _sources(system, among)
    place = {name: i for i, name in enumerate(sources)}
    return [
        _opened(part, sources, place)
        for part in _strongly_connected(sources)
        if len(part) > 1 or part[0] in sources[part[0]]
    ]


def derived_order(system: System, solved: Sequence[Sequence[str]] = ()) -> list[str]:
    """All components: one with direct feedthrough comes before those that it feeds.

    No order does that for every connection of a ring. The component of the ring that stands first
    in the system then comes first, and takes one step late what feeds it; where the others are a
    ring still, it is opened in the same way: see :func:`delayed_connections`.

    Args:
        system: that is stepped.
        solved: rings that are stepped as one component each, after all that does not wait for
            them: so they can be closed with the latest of what feeds them.

    """
    ring_of = {name: ring for ring in solved for name in ring}
    # A ring stands where the first of its components stands.
    place = {name: i for i, name in enumerate(system.components)}
    firsts = [(min(ring, key=place.__getitem__), ring) for ring in solved]
    lead = {name: first for first, ring in firsts for name in ring}
    sources: dict[str, set[str]] = {lead.get(name, name): set() for name in system.components}
    for name, feeding in _sources(system).items():
        own = lead.get(name, name)
        sources[own] |= {lead.get(source, source) for source in feeding}
        if name in lead:
            sources[own].discard(own)
    order = _in_levels(_without_rings(sources), set(lead.values()))
    return [member for name in order for member in ring_of.get(name, (name,))]


def delayed_connections(
    system: System, order: Sequence[str], solved: Iterable[Sequence[str]] = ()
) -> list[Connection]:
    """The connections with direct feedthrough that an order makes one step late.

    Args:
        system: that is stepped.
        order: all its components, one stepped after the other.
        solved: rings that are stepped as one component each.

    """
    place = {name: i for i, name in enumerate(order)}
    ring_of = {name: i for i, ring in enumerate(solved) for name in ring}
    return [
        connection
        for connection in system.connections
        if has_feedthrough(system, connection)
        and place[source := connection.source.component]
        >= place[target := connection.target.component]
        and not (source in ring_of and ring_of[source] == ring_of.get(target))
    ]


def in_stages(
    system: System, order: Sequence[str], solved: Sequence[Sequence[str]] = ()
) -> list[list[str]]:
    """An order in stages: no component takes what another one of its stage has just computed.

    Solved rings have their own stages, each in the place of its first component.
    """
    ring_of = {name: ring for ring in map(list, solved) for name in ring}
    units: dict[str, list[str]] = {}
    for name in order:
        ring = ring_of.get(name, [name])
        units.setdefault(ring[0], ring)
    late = set(
        delayed_connections(system, [name for unit in units.values() for name in unit], solved)
    )
    feeding: dict[str, set[str]] = {name: set() for name in order}
    for connection in system.connections:
        if has_feedthrough(system, connection) and connection not in late:
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


def reaching(system: System, component: str, until: set[str]) -> Iterator[Connection]:
    """The connections through which values reach a component, directly or through others.

    Args:
        system: whose connections are followed upstream.
        component: where the values arrive.
        until: components that are not followed further.

    """
    seen, waiting = {component}, [component]
    while waiting:
        for connection in system.feeding[waiting.pop()]:
            yield connection
            source = connection.source.component
            if source not in seen | until:
                seen.add(source)
                waiting.append(source)


def _sources(system: System, among: Collection[str] | None = None) -> dict[str, set[str]]:
    counted = (name for name in system.components if among is None or name in among)
    found: dict[str, set[str]] = {name: set() for name in counted}
    for connection in system.connections:
        source, target = connection.source.component, connection.target.component
        if source in found and target in found and has_feedthrough(system, connection):
            found[target].add(source)
    return found


def _without_rings(sources: _Sources) -> dict[str, set[str]]:
    """What each waits for once all rings are opened: in a ring, for the one before it."""
    place = {name: i for i, name in enumerate(sources)}
    found: dict[str, set[str]] = {}
    for part in _strongly_connected(sources):
        before: set[str] = set()
        ring = set(part)
        for name in _opened(part, sources, place):
            found[name] = {source for source in sources[name] if source not in ring} | before
            before = {name}
    return {name: found[name] for name in sources}


def _in_levels(sources: _Sources, last: Collection[str]) -> list[str]:
    """The components of a graph without rings: first those that wait for nothing, and so on.

    Some come last, when nothing else is left that does not wait for them.
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


def _opened(ring: Sequence[str], sources: _Sources, place: Mapping[str, int]) -> list[str]:
    """A ring in the order in which it is opened: its first, then the rest, part by part.

    What is left of a ring may be rings again, and so on inwards. They are found from the inmost
    outwards: components are added to a graph, the last first, and each of them becomes one with
    those that it closes a ring with. That takes time in proportion to the connections, except
    for rings that are made to be slow.
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
        parts[first] = _in_levels(waiting, ())
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
    """What feeds a component, directly or through others, and is fed by it.

    The search goes both ways at the same time, until one of them has come to its end.
    """
    ways = (feeding, fed)
    found: tuple[set[str], set[str]] = (set(), set())
    ahead = [[first], [first]]
    while all(ahead):
        for neighbours, known, waiting in zip(ways, found, ahead, strict=True):
            new = neighbours[waiting.pop()] - known
            known |= new
            waiting += new
    done = 0 if not ahead[0] else 1
    within, neighbours = found[done], ways[1 - done]
    closing: set[str] = set()
    waiting = [first]
    while waiting:
        new = (neighbours[waiting.pop()] & within) - closing
        closing |= new
        waiting += new
    return closing - {first}


def _strongly_connected(sources: _Sources) -> list[list[str]]:
    """Components in parts of which each waits for all others of its part (Tarjan 1972).

    Returns:
        The parts; one comes after those that it waits for.

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


def unfed_inputs(system: System, settled: Collection[PortName] = ()) -> str | None:
    """The inputs that nothing feeds or sets, in words, with wires that could feed them.

    Args:
        system: that is looked at.
        settled: inputs that are set during a run.

    Returns:
        One line; None: there is no such input.

    """
    fed = {connection.target for connection in system.connections}
    feeding = {
        (connection.source.component, connection.target.port) for connection in system.connections
    }
    taken = {*fed, *system.parameters, *system.left_open, *settled}
    labels: list[str] = []
    wires: list[str] = []
    giving: dict[str, list[str]] = {}
    for name, component in system.components.items():
        for output in component.having("output"):
            giving.setdefault(output.name, []).append(name)
    for name, component in system.components.items():
        groups: dict[str, list[Variable]] = {}
        for variable in component.having("input"):
            groups.setdefault(variable.name.rpartition(".")[0], []).append(variable)
        for group, members in groups.items():
            found = [v for v in members if PortName(name, v.name) not in taken]
            if not group or len(found) < len(members):
                labels += [f"{name}.{variable.name}" for variable in found]
                continue
            labels.append(f"{name}.{group}.*")
            # What feeds the same inputs of another component is that one's.
            sources = (
                other
                for other in giving.get(members[0].name, ())
                if other != name
                and all(_could_feed(system.components[other], variable) for variable in members)
                and not any((other, variable.name) in feeding for variable in members)
            )
            first, second = next(sources, None), next(sources, None)
            if first is not None and second is None:
                wires.append(f'"{name}.{group}" = "{first}.{group}"')
    if not labels:
        return None
    wanted = f"; wire {listed(wires)}" if wires else ""
    return f"nothing feeds or sets {listed(labels)}{wanted}"


def _could_feed(source: Component, variable: Variable) -> bool:
    """Whether a component has an output of the name and type of an input."""
    output = source.variables.get(variable.name)
    return output is not None and output.causality == "output" and can_feed(output, variable)
