"""Indices of a system, and where their signals are in its program."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from fmus.ports.reducer import Reducer
from orchestrator.cosim import PortName, System
from orchestrator.vehicle.reduction import sources_of
from orchestrator.vehicle.signals import Loop


class Looking(NamedTuple):
    """An index of a system: what makes it, and where its signals are.

    Attributes:
        reducer: that makes it.
        sources: of the ports of its rows, in their order: ports or parameters, or constants.

    """

    reducer: Reducer
    sources: Sequence[PortName | float]


def looking_at(system: System, loop: Loop, reducers: Iterable[Reducer]) -> Iterator[Looking]:
    """Those of some indices of a loop for which a system has all signals and parameters."""
    names = [
        f"{name}.{variable.name}"
        for name, component in system.components.items()
        for causality in ("input", "output", "parameter")
        for variable in component.having(causality)
    ]
    places = {name: i for i, name in enumerate(names)}
    for reducer in reducers:
        found = sources_of(reducer, loop, places, {})
        if not found.missing:
            sources: dict[str, PortName | float] = {
                port: float(value) for port, value in found.constants.items()
            }
            sources |= {
                port: system.named(PortName.read(names[i])) for port, i in found.places.items()
            }
            yield Looking(reducer, [sources[port.name] for port in reducer.ports])
