"""Names of ports in a system."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from orchestrator.machine.errors import InputError


@dataclass(frozen=True)
class PortName:
    """A port of a component in a system."""

    component: str
    port: str

    def __str__(self) -> str:
        """`component.port`, as in files and on the command line."""
        return f"{self.component}.{self.port}"

    @classmethod
    def read(cls, text: str) -> PortName:
        """Take `component.port` apart at the first dot.

        A component's name may have dots as well: only the system knows which of them ends it
        (:meth:`.structure.System.named`).

        Raises:
            InputError: there is no dot.

        """
        component, dot, port = text.partition(".")
        if not (component and dot and port):
            raise InputError(f"{text!r}: write COMPONENT.PORT or COMPONENT.PARAMETER")
        return cls(component, port)

    @staticmethod
    def splits(text: str) -> Iterator[tuple[str, str]]:
        """The ways to take a name apart, the longest name of a component first."""
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
