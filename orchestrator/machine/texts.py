"""Numbers, truth values and texts as files write them."""

from __future__ import annotations

import sys
from contextlib import suppress
from math import isfinite

#: Truth values, as XML writes them.
BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


def real(text: str) -> float:
    """A number as every program reads it: only Python takes 1_000, and digits of any script."""
    return float(_plain(text))


def integer(text: str) -> int:
    """A whole number as every program reads it."""
    return int(_plain(text))


def finite(text: str, where: str) -> float:
    """A number that can be computed with, from a file.

    Args:
        text: of the number.
        where: it stands, for the message.

    Raises:
        ValueError: it is not one.

    """
    try:
        number = real(text)
    except ValueError:
        raise ValueError(f"{where} {text[:40]!r} is not a number") from None
    if not isfinite(number):
        raise ValueError(f"{where} {text[:40]!r} is not finite")
    return number


def whole(text: str, where: str) -> int:
    """An integer from a file, which other tools may have written with a point.

    Args:
        text: of the number.
        where: it stands, for the message.

    Raises:
        ValueError: it is not one.

    """
    number = finite(text, where)
    with suppress(ValueError):
        return integer(text)
    if not number.is_integer():
        raise ValueError(f"{where} {text[:40]!r} is not an integer")
    return int(number)


def is_finite(value: object) -> bool:
    """Whether it is a number that can be computed with: TOML has nan, inf, and endless integers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _plain(text: str) -> str:
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a plain number")
    return text


def transferable(text: str) -> str:
    """A text that FMI can carry: in UTF-8, and ended by the first zero."""
    text.encode()
    if "\0" in text:
        raise ValueError("a text cannot contain a zero character")
    return text


def literal(value: float | bool | str) -> str:
    """A value as XML writes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
