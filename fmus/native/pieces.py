"""Pieces of C that are written around translated equations."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import NamedTuple

from fmus.language.types import FLOAT, Array, Scalar, Type, count, parts_of
from fmus.native.emit import INDENT, lines_of, members


class Place(NamedTuple):
    """A number in a value: its expression in C, and its type."""

    text: str
    type: Scalar


def scalars(type_: Type, text: str) -> Iterator[Place]:
    """Yield all numbers in a value, in order."""
    if isinstance(type_, Scalar):
        yield Place(text, type_)
    for suffix, part in members(type_):
        yield from scalars(part, text + suffix)


def initializer(type_: Type, texts: Iterator[str]) -> str:
    """Return the initializer of a value from the expressions of its numbers."""
    if isinstance(type_, Scalar):
        return next(texts) if type_ == FLOAT else f"(int)({next(texts)})"
    parts = ", ".join(initializer(part, texts) for _, part in members(type_))
    return f"{{{{{parts}}}}}" if isinstance(type_, Array) else f"{{{parts or '0'}}}"


def function(head: str, lines: Sequence[str], arguments: Sequence[str] = ("error",)) -> str:
    """Return a function of statements; unused arguments are cast to void."""
    found = []
    for line in lines:
        inner = line.lstrip()
        found += lines_of(inner, " " * (4 + len(line) - len(inner)))
    text = "\n".join(found)
    unused = [f"    (void){name};" for name in arguments if not re.search(rf"\b{name}\b", text)]
    return "\n".join([f"{head} {{", *unused, *found, "}"])


def structure(name: str, rows: Sequence[str]) -> str:
    """Return a structure with members; C has no empty structures."""
    body = "\n".join(f"    {row}" for row in rows or ["char nothing;"])
    return f"typedef struct {{\n{body}\n}} {name};"


def array(head: str, items: Iterable[str]) -> str:
    """Return an array of constants."""
    return "\n".join(lines_of(f"static const {head}[] = {{{', '.join(items)}}};", ""))


# Numbers of structures


@cache
def has_only_doubles(type_: Type) -> bool:
    """Return True if a structure has the layout of an array of doubles."""
    if isinstance(type_, Array):
        return has_only_doubles(type_.item)
    parts = parts_of(type_)
    return all(map(has_only_doubles, parts)) if parts else type_ == FLOAT


def moves(
    type_: Type,
    member: str,
    places: Sequence[int],
    text: str,
    depth: int = 0,
    place: str = "",
    whole: str = "",
) -> Iterator[str]:
    """Yield statements that move each number of a structure, with loops over arrays.

    Numbers of 32-bit ints are exact in doubles.

    Args:
        type_: type of the structure.
        member: its expression in C.
        places: indices of its numbers in an array of doubles.
        text: a statement with `{member}`, `{place}` and `{cast}`.
        depth, place: depth and index of the surrounding loop.
        whole: the statement for ints, if it differs.

    """
    indent = INDENT * depth
    if isinstance(type_, Scalar):
        cast = "" if type_ == FLOAT else "(int)"
        text = text if type_ == FLOAT else whole or text
        yield indent + text.format(member=member, place=place or places[0], cast=cast)
        return
    if _is_uniform(type_):
        assert isinstance(type_, Array)
        letter, step = f"i{depth}", count(type_.item)
        before = place or (str(places[0]) if places[0] else "")
        further = f"{step} * {letter}" if step > 1 else letter
        yield f"{indent}for (int {letter} = 0; {letter} < {type_.n}; {letter}++) {{"
        at = f"{before} + {further}" if before else further
        yield from moves(type_.item, f"{member}.v[{letter}]", places, text, depth + 1, at, whole)
        yield f"{indent}}}"
        return
    for suffix, part in members(type_):
        n = count(part)
        if n:
            yield from moves(part, f"{member}{suffix}", places[:n], text, depth, whole=whole)
        places = places[n:]


def _is_uniform(type_: Type) -> bool:
    """Return True for a number, or nested arrays of one type of number."""
    return isinstance(type_, Scalar) or (isinstance(type_, Array) and _is_uniform(type_.item))
