"""The graph of a system: what depends on what."""

from __future__ import annotations

from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter

from orchestrator.errors import InputError
from orchestrator.system.structure import Connection, System


def has_feedthrough(system: System, connection: Connection) -> bool:
    """Whether the source of a connection depends on an input of the same instant."""
    source = connection.source
    return system.components[source.component].has_feedthrough(source.port)


def feedthrough_stages(system: System) -> list[list[str]]:
    """Components, in stages: one with direct feedthrough comes before those that it feeds.

    Raises:
        InputError: direct feedthroughs form a loop.

    """
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(system.components, ()))
    for connection in system.connections:
        if has_feedthrough(system, connection):
            sorter.add(connection.target.component, connection.source.component)
    try:
        sorter.prepare()
    except CycleError as error:
        loop = " -> ".join(error.args[1])
        raise InputError(
            f"direct feedthrough in a loop, {loop}; --order jacobi breaks it with a delay"
        ) from error
    stages = []
    while sorter.is_active():
        ready = sorter.get_ready()
        stages.append([name for name in system.components if name in ready])
        sorter.done(*ready)
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
