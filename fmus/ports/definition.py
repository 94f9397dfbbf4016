"""What a component is: the one thing that both kinds of FMU, and its page, are made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

from fmus.ports.behaviour import Behaviour, read_behaviour
from fmus.ports.groups import ParameterSet
from fmus.ports.port import Port


class Origin(NamedTuple):
    """Where a component comes from."""

    author: str = ""
    license: str = ""
    version: str = ""
    citation: str = ""  #: what its equation numbers refer to


@dataclass(frozen=True, eq=False)
class Definition:
    """A component.

    Attributes:
        name: of the component, and of its FMU.
        summary: one line.
        origin: where it comes from.
        ports: all but `fault`, in the order of their value references.
        parameters: what its parameters mean to the equations.
        group_of: fields of its inputs that bear another name than their group of ports.
        behaviour: how it runs.

    """

    name: str
    summary: str
    origin: Origin
    ports: tuple[Port, ...]
    parameters: ParameterSet[Any]
    group_of: Mapping[str, str]
    behaviour: Behaviour

    @property
    def about(self) -> dict[str, str]:
        """What modelDescription.xml says of its origin."""
        said = self.origin._asdict()
        del said["citation"]
        return {name: text for name, text in said.items() if text}

    @property
    def description(self) -> str:
        """What modelDescription.xml says of it."""
        return ". ".join(filter(None, (self.summary, self.origin.citation)))


@cache
def define(name: str, *modules: ModuleType) -> Definition:
    """What modules say of a component, the same each time.

    Args:
        name: of the component.
        modules: `ports` and `behaviour` of its folder.

    Raises:
        TypeError: they do not go together.

    """
    ports, behaviour = modules
    return Definition(
        name,
        ports.DESCRIPTION,
        getattr(ports, "ORIGIN", Origin()),
        ports.PORTS,
        ports.PARAMETERS,
        getattr(ports, "GROUP_OF", {}),
        read_behaviour(behaviour),
    )
