"""Pieces of C that are written by hand around translated equations."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from fmus.language.types import FLOAT, Array, Scalar, Type
from fmus.native.emit import lines_of, members


class Place(NamedTuple):
    """A number in a value: where it lies, and its type."""

    text: str
    type: Scalar


def scalars(type_: Type, text: str) -> Iterator[Place]:
    """All numbers in a value, in their order."""
    if isinstance(type_, Scalar):
        yield Place(text, type_)
    for suffix, part in members(type_):
        yield from scalars(part, text + suffix)


def initializer(type_: Type, texts: Iterator[str]) -> str:
    """A value from the texts of its numbers."""
    if isinstance(type_, Scalar):
        return next(texts) if type_ == FLOAT else f"(int)({next(texts)})"
    parts = ", ".join(initializer(part, texts) for _, part in members(type_))
    return f"{{{{{parts}}}}}" if isinstance(type_, Array) else f"{{{parts or '0'}}}"


def function(head: str, lines: Sequence[str], arguments: Sequence[str] = ("error",)) -> str:
    """A function of statements; arguments that it does not use are marked so."""
    found = [line for one in lines for line in _indented(one)]
    text = "\n".join(found)
    unused = [f"    (void){name};" for name in arguments if not re.search(rf"\b{name}\b", text)]
    return "\n".join([f"{head} {{", *unused, *found, "}"])


def structure(name: str, rows: Sequence[str]) -> str:
    """A structure of members; C has none without."""
    body = "\n".join(f"    {row}" for row in rows or ["char nothing;"])
    return f"typedef struct {{\n{body}\n}} {name};"


def array(head: str, items: Iterable[str]) -> str:
    """An array of constants."""
    return "\n".join(lines_of(f"static const {head}[] = {{{', '.join(items)}}};", ""))


def _indented(line: str) -> list[str]:
    inner = line.lstrip()
    return lines_of(inner, " " * (4 + len(line) - len(inner)))
