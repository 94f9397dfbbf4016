"""Several vehicles in a scenario: `auv1`, `auv2`, ..., each with components of its own.

In names of components, `auv*` stands for each of them; on both sides of a wire, for the same one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

T = TypeVar("T", bound=object)

#: What their names begin with, before their numbers.
_VEHICLE = "auv"

#: Each of them, in a name.
_EACH = f"{_VEHICLE}*"

#: More take longer to put together than they are worth.
MOST_VEHICLES = 10_000


def of_vehicles(table: Mapping[str, T], vehicles: int | None) -> dict[str, T]:
    """What stands by names of a single vehicle's components, for each vehicle.

    Args:
        table: by names of components or ports; so are texts in it that have a dot.
        vehicles: how many there are; None: a single one, whose components have no prefix.

    """
    if vehicles is None:
        return dict(table)
    starred = {
        f"{_EACH}.{name}": f"{_EACH}.{value}" if "." in str(value) else value
        for name, value in table.items()
    }
    return for_each(starred, vehicles)  # type: ignore[arg-type]


def for_each(table: Mapping[str, T], vehicles: int | None) -> dict[str, T]:
    """A table with an entry for each vehicle in the place of one for all; names of one win."""
    found: dict[str, T] = {}
    for name in sorted(table, key=lambda name: _EACH not in name):
        value = table[name]
        for number in _numbers(name, vehicles):
            taken = value.replace(_EACH, number) if isinstance(value, str) else value
            found[name.replace(_EACH, number)] = taken  # type: ignore[assignment]
    return found


def named(names: list[str], vehicles: int | None) -> list[str]:
    """Names, with one for each vehicle in the place of one for all."""
    return [name.replace(_EACH, number) for name in names for number in _numbers(name, vehicles)]


def role_of(component: str) -> str:
    """What a component is called in its vehicle."""
    return component.rpartition(".")[2]


def _numbers(name: str, vehicles: int | None) -> list[str]:
    """What stands in a name in the place of all vehicles; once nothing, if it is not there."""
    if vehicles is None or _EACH not in name:
        return [_EACH]
    return [f"{_VEHICLE}{number}" for number in range(1, vehicles + 1)]
