"""Numbers, truth values and texts in files, patterns of names, and nested tables."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from math import isfinite
from typing import Any

from orchestrator.machine.errors import InputError, did_you_mean, escape_unprintable

#: Truth values, as XML writes them.
BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


def real(text: str) -> float:
    """Read a number as all programs do: only Python accepts 1_000, and digits of any script."""
    return float(_plain(text))


def integer(text: str) -> int:
    """Read a whole number as all programs do."""
    return int(_plain(text))


def finite(text: str, where: str) -> float:
    """Read a finite number from a file; `where` is its place for the message.

    Raises:
        ValueError: it is not a finite number.

    """
    try:
        number = real(text)
    except ValueError:
        raise ValueError(f"{where} {text[:40]!r} is not a number") from None
    if not isfinite(number):
        raise ValueError(f"{where} {text[:40]!r} is not finite")
    return number


def in_docstring(name: str) -> str:
    """Escape the name of a file for a docstring, in backticks."""
    shown = escape_unprintable(name).replace("`", "'")
    return shown.replace("\\", r"\\").replace('"', r"\"")


def whole(text: str, where: str) -> int:
    """Read an integer from a file, which other tools may have written with a decimal point.

    Raises:
        ValueError: it is not an integer.

    """
    number = finite(text, where)
    with suppress(ValueError):
        return integer(text)
    if not number.is_integer():
        raise ValueError(f"{where} {text[:40]!r} is not an integer")
    return int(number)


def is_finite(value: object) -> bool:
    """Return True for a finite number: TOML has nan, inf, and integers of any length."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _plain(text: str) -> str:
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a plain number")
    return text


def transferable(text: str) -> str:
    """Return a text, if FMI can pass it: as UTF-8 that ends at the first zero."""
    text.encode()
    if "\0" in text:
        raise ValueError("a text cannot contain a zero character")
    return text


def literal(value: float | bool | str) -> str:
    """Write a value as in XML."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def matching(names: Sequence[str], patterns: Sequence[str]) -> list[str]:
    """Return the names that match at least one pattern such as `a.b.*`, in their own order.

    Raises:
        InputError: a pattern matches no name.

    """
    for pattern in patterns:
        if not any(matches(name, pattern) for name in names):
            raise InputError(f"no column matches {pattern!r}{did_you_mean(pattern, names)}")
    return [name for name in names if any(matches(name, pattern) for pattern in patterns)]


def matches(name: str, pattern: str) -> bool:
    """Return True if a name is the pattern, is in the group it names, or fits its wildcards."""
    # Brackets are part of names of arrays, not sets of letters.
    escaped = pattern.replace("[", "[[]")
    is_member = name.startswith((f"{pattern}.", f"{pattern}["))
    return name == pattern or is_member or fnmatchcase(name, escaped)


def flatten(
    table: Mapping[str, Any], is_value: Callable[[Any], bool] = lambda _: False, prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    """Flatten a table to values by dotted names, whether its keys were quoted or dotted.

    Args:
        table: nested tables.
        is_value: returns True for a table that is a value itself.
        prefix: prefix of all names.

    """
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if isinstance(value, Mapping) and not is_value(value):
            yield from flatten(value, is_value, name)
        else:
            yield name, value
