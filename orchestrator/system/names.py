"""Names of ports in a system."""

from __future__ import annotations

from dataclasses import dataclass

from orchestrator.errors import InputError


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

    Raises:
        InputError: there is no dot.

    """
    component, dot, port = text.partition(".")
    if not (component and dot and port):
        raise InputError(f"{text!r}: write component.port")
    return PortName(component, port)
