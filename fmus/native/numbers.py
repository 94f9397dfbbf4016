"""The numbers of structures in C, as they move to and from arrays of doubles.

Ints of 32 bits are exact in doubles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache

from fmus.language.types import FLOAT, Array, Scalar, Type, count, parts_of
from fmus.native.emit import INDENT, members


@cache
def has_only_doubles(type_: Type) -> bool:
    """Whether a structure is an array of doubles; C has no empty structure within it."""
    if isinstance(type_, Array):
        return has_only_doubles(type_.item)
    parts = parts_of(type_)
    return all(map(has_only_doubles, parts)) if parts else type_ == FLOAT


def moves(
    type_: Type, member: str, places: Sequence[int], text: str, depth: int = 0, place: str = ""
) -> Iterator[str]:
    """A statement for each number of a structure, in loops over arrays of numbers that are alike.

    Args:
        type_: of the structure.
        member: what it is called.
        places: of its numbers, where they move to or come from.
        text: of a statement, with `{member}`, `{place}` and `{cast}`.
        depth, place: of the loop that this stands in.

    """
    indent = INDENT * depth
    if isinstance(type_, Scalar):
        cast = "" if type_ == FLOAT else "(int)"
        yield indent + text.format(member=member, place=place or places[0], cast=cast)
        return
    if _is_even(type_):
        assert isinstance(type_, Array)
        letter, step = f"i{depth}", count(type_.item)
        before = place or (str(places[0]) if places[0] else "")
        further = f"{step} * {letter}" if step > 1 else letter
        yield f"{indent}for (int {letter} = 0; {letter} < {type_.n}; {letter}++) {{"
        at = f"{before} + {further}" if before else further
        yield from moves(type_.item, f"{member}.v[{letter}]", places, text, depth + 1, at)
        yield f"{indent}}}"
        return
    for suffix, part in members(type_):
        n = count(part)
        if n:
            yield from moves(part, f"{member}{suffix}", places[:n], text, depth)
        places = places[n:]


def _is_even(type_: Type) -> bool:
    """Whether a type is a number, or an array of what is even."""
    return isinstance(type_, Scalar) or (isinstance(type_, Array) and _is_even(type_.item))
