"""Variables of model exchange: continuous states, their rates and event indicators."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import Any

from fmus.ports.behaviour import Behaviour
from fmus.ports.fields import declared
from fmus.ports.groups import count_values, fields_of
from fmus.ports.port import TIME, Port
from fmus.ports.units import rate_of


def exchanged(behaviour: Behaviour) -> tuple[Port, ...]:
    """Return the variables of model exchange of a component; without rates, none."""
    if behaviour.rates is None:
        return ()
    states = [*_local(behaviour.rates, "state.")]
    rates = [
        replace(
            state,
            name=f"der({state.name})",
            description=f"Rate of {state.name}",
            unit=rate_of(state.unit or "") or None,
            derivative=state.name,
            feedthrough=(TIME.name,) if behaviour.takes("rates", "t") else (),
        )
        for state in states
    ]
    switches = [] if behaviour.switches is None else _local(behaviour.switches, "switch.")
    return (*states, *rates, *switches)


def _local(made: Any, prefix: str) -> Iterator[Port]:
    """Yield the local variables of a class."""
    for port in chain(*declared(made, "local", prefix=prefix).values()):
        yield replace(port, array=None)


def places_of_states(behaviour: Behaviour) -> list[int]:
    """Return the places of the continuous states among the numbers of the state."""
    if behaviour.rates is None:
        return []
    found: dict[str, list[int]] = {}
    place = 0
    for name, hint in fields_of(behaviour.state).items():
        found[name] = [*range(place, place := place + count_values(hint))]
    return [place for name in fields_of(behaviour.rates) for place in found[name]]
