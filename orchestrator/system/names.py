"""Names in a system: of ports, and of files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
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

    A component's name may have dots as well: which of them it is that parts it from the port, the
    system knows (:meth:`.structure.System.named`).

    Raises:
        InputError: there is no dot.

    """
    component, dot, port = text.partition(".")
    if not (component and dot and port):
        raise InputError(f"{text!r}: write component.port")
    return PortName(component, port)


def splits(text: str) -> Iterator[tuple[str, str]]:
    """The ways to take a name apart, the one with the longest name of a component first."""
    dot = text.rfind(".")
    while dot >= 0:
        yield text[:dot], text[dot + 1 :]
        dot = text.rfind(".", 0, dot)


def plain(names: Iterable[str], *taken: str) -> list[str]:
    """Names of files that need no encoding in a URI, of which some hosts know nothing.

    No two are the same, nor differ in case only: some file systems do not tell them apart.

    Args:
        names: as they are.
        taken: names that are not free.

    """
    found: list[str] = []
    used = {name.lower() for name in taken}
    for name in names:
        base = re.sub(r"[^\w.-]", "_", name, flags=re.ASCII)
        free, number = base, len(found)
        while free.lower() in used:
            free, number = f"{number}_{base}", number + 1
        found.append(free)
        used.add(free.lower())
    return found
