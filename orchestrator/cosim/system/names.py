"""Names in a system: of ports, and of files; several of them in a message."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from orchestrator.machine.errors import InputError

#: What may be in the name of a file on every system, words that Windows keeps for itself, and how
#: long a name may be [bytes] to leave room for what follows it.
_ODD, _KEPT = (
    re.compile(r"[^\w .()+=,@~-]"),
    re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.I),
)
_LONGEST = 120

#: Of many names, this many are said.
_MOST_SAID = 5


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


def flatten(
    table: Mapping[str, Any], is_value: Callable[[Any], bool] = lambda _: False, prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    """Flatten a table to values by dotted names, whether its keys were quoted or dotted.

    Args:
        table: with tables in it.
        is_value: whether a table in it is a value itself.
        prefix: of all names.

    """
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if isinstance(value, Mapping) and not is_value(value):
            yield from flatten(value, is_value, name)
        else:
            yield name, value


def for_each(star: str, names: Sequence[str], table: Mapping[str, Any]) -> dict[str, Any]:
    """A table with an entry for each name in the place of one with a star; others win.

    Args:
        star: that stands for a name, in keys, and in texts that are their values.
        names: that it stands for.
        table: by texts that may have it.

    """
    found = {
        key.replace(star, name): value.replace(star, name) if isinstance(value, str) else value
        for name in names
        for key, value in table.items()
        if star in key
    }
    return found | {key: value for key, value in table.items() if star not in key or not names}


def file_name(name: str, taken: Collection[str] = ()) -> str:
    """A name for a file or folder, which every system takes and no other name becomes.

    Args:
        name: of anything.
        taken: names of files that there are beside it.

    """
    plain = _ODD.sub("_", name).strip(" ").rstrip(".")
    plain = plain.encode()[:_LONGEST].decode(errors="ignore")
    if not plain or plain.startswith(".") or _KEPT.match(plain):
        plain = f"_{plain}"
    if plain != name:
        plain += f"-{sha256(name.encode(errors='surrogatepass')).hexdigest()[:8]}"
    others = {other.casefold() for other in taken}
    while plain.casefold() in others:
        plain += "_"
    return plain


def plain_file_names(names: Iterable[str], *taken: str) -> list[str]:
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


def listed(names: Sequence[str], between: str = ", ") -> str:
    """Names, of many the first, with something between them."""
    more = len(names) - _MOST_SAID
    return between.join(names[:_MOST_SAID]) + (f" and {more} more" if more > 0 else "")
