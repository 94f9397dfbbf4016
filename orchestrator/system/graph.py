"""The graph of a system: what depends on what, and which order of stepping follows from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from orchestrator.system.structure import Connection, System


def has_feedthrough(system: System, connection: Connection) -> bool:
    """Whether the source of a connection depends on an input of the same instant."""
    source = connection.source
    return system.components[source.component].has_feedthrough(source.port)


def derived_order(system: System) -> list[str]:
    """All components: one with direct feedthrough comes before those that it feeds.

    No order does that for every connection of a ring. The component of the ring that stands first
    in the system then comes first, and takes one step late what feeds it: see :func:`delayed`.
    """
    waiting: dict[str, set[str]] = {name: set() for name in system.components}
    for connection in system.connections:
        if has_feedthrough(system, connection):
            waiting[connection.target.component].add(connection.source.component)
    order: list[str] = []
    while waiting:
        ready = [name for name, sources in waiting.items() if not sources & waiting.keys()]
        # A ring that waits for no other one is all that its components wait for.
        chosen = ready or [min(waiting, key=lambda name: len(_upstream(waiting, name)))]
        for name in chosen:
            del waiting[name]
        order += chosen
    return order


def _upstream(sources: Mapping[str, set[str]], component: str) -> set[str]:
    """What a component waits for, directly or through others."""
    found: set[str] = set()
    ahead = [component]
    while ahead:
        new = (sources[ahead.pop()] & sources.keys()) - found
        found |= new
        ahead += new
    return found


def delayed(system: System, order: Sequence[str]) -> list[Connection]:
    """The connections with direct feedthrough that an order makes one step late.

    Args:
        system: that is stepped.
        order: all its components, one stepped after the other.

    """
    place = {name: i for i, name in enumerate(order)}
    return [
        connection
        for connection in system.connections
        if has_feedthrough(system, connection)
        and place[connection.source.component] >= place[connection.target.component]
    ]


def in_stages(system: System, order: Sequence[str]) -> list[list[str]]:
    """An order in stages: no component takes what another one of its stage has just computed."""
    late = set(delayed(system, order))
    feeding: dict[str, set[str]] = {name: set() for name in order}
    for connection in system.connections:
        if has_feedthrough(system, connection) and connection not in late:
            feeding[connection.target.component].add(connection.source.component)
    stages: list[list[str]] = [[]]
    for name in order:
        if feeding[name].intersection(stages[-1]):
            stages.append([])
        stages[-1].append(name)
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
        name = waiting.pop()
        for connection in system.connections:
            if connection.target.component == name:
                yield connection
                source = connection.source.component
                if source not in seen | until:
                    seen.add(source)
                    waiting.append(source)
