"""What a file of the user's may hold, and whether one holds that and nothing else."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from orchestrator.machine.errors import Findings, did_you_mean, shortened


class Entry(NamedTuple):
    """An entry of a file.

    Attributes:
        kind: what its value is, in words.
        fits: whether a value is of that kind.
        meaning: what it does.
        default: what goes without it, in words.

    """

    kind: str
    fits: Callable[[Any], bool]
    meaning: str
    default: str


def check_entries(where: object, content: Mapping[str, Any], entries: Mapping[str, Entry]) -> None:
    """Check that a table holds nothing but what it may, each of its kind.

    Args:
        where: it stands, for the message.
        content: of the table.
        entries: that it may have.

    Raises:
        Refused: it holds something else.

    """
    findings = Findings()
    for key, value in content.items():
        if key not in entries:
            hint = did_you_mean(key, entries) or f"; use {', '.join(entries)}"
            findings.problem(f"{where}: unknown entry {key!r}{hint}")
        elif not entries[key].fits(value):
            shown = shortened(repr(value))
            findings.problem(
                f"{where}: {key} = {shown} is of the wrong type, not a {entries[key].kind}"
            )
    findings.refuse()


def is_text(value: Any) -> bool:
    """Whether it is a text."""
    return isinstance(value, str)


def is_flag(value: Any) -> bool:
    """Whether it is true or false."""
    return isinstance(value, bool)


def is_number(value: Any) -> bool:
    """Whether it is a number, which a truth value is not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def is_finite(value: Any) -> bool:
    """Whether it is a number that can be computed with: TOML has nan, inf, and endless integers."""
    return is_number(value) and abs(value) <= sys.float_info.max


def is_table(value: Any) -> bool:
    """Whether it is a table."""
    return isinstance(value, dict)


def are_names(value: Any) -> bool:
    """Whether it is a list of texts."""
    return isinstance(value, list) and all(map(is_text, value))


def flattened(
    table: Mapping[str, Any], is_value: Callable[[Any], bool] = lambda _: False, prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    """The values of a table by dotted names, whether keys were quoted or dotted.

    Args:
        table: with tables in it.
        is_value: whether a table in it is a value itself.
        prefix: of all names.

    """
    for key, value in table.items():
        name = f"{prefix}.{key}" if prefix else key
        if is_table(value) and not is_value(value):
            yield from flattened(value, is_value, name)
        else:
            yield name, value
