"""Names of ports in a system."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.machine.errors import InputError


@dataclass(frozen=True)
class PortName:
    """A port of a component in a system."""

    component: str
    port: str

    def __str__(self) -> str:
        """`component.port`, as in files and on the command line."""
        return f"{self.component}.{self.port}"


def port_name(text: str) -> PortName:
    """`component.port`, taken apart at the first dot.

    A component's name may have dots as well: which of them it is that parts it from the port, the
    system knows (:meth:`.structure.System.named`).

    Raises:
        InputError: there is no dot.

    """
    component, dot, port = text.partition(".")
    if not (component and dot and port):
        raise InputError(f"{text!r}: write COMPONENT.PORT or COMPONENT.PARAMETER")
    return PortName(component, port)


def splits(text: str) -> Iterator[tuple[str, str]]:
    """The ways to take a name apart, the one with the longest name of a component first."""
    dot = text.rfind(".")
    while dot >= 0:
        yield text[:dot], text[dot + 1 :]
        dot = text.rfind(".", 0, dot)


def likely_port(name: PortName, components: Collection[str]) -> PortName:
    """A name that begins with no component, taken apart after the systems that it begins with."""
    outer, inner = name.component, name.port
    while "." in inner and any(one.startswith(f"{outer}.") for one in components):
        part, _, inner = inner.partition(".")
        outer = f"{outer}.{part}"
    return PortName(outer, inner)


def paired(
    name: object, ports: Sequence[PortName], values: Sequence[Any]
) -> Iterator[tuple[PortName, Any]]:
    """The ports of a group, each with its value.

    Raises:
        InputError: there are more of one than of the other.

    """
    if len(values) != len(ports):
        raise InputError(f"{name}: takes {len(ports)} values, not {len(values)}")
    return zip(ports, values, strict=True)


def role_of(component: str) -> str:
    """What a component is called in its innermost system."""
    return component.rpartition(".")[2]
