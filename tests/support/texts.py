"""Numbers and names in a text, whose other words are not tested."""

from __future__ import annotations

import re
from collections.abc import Sequence

_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def numbers_in(text: str) -> list[float]:
    """All numbers of a text, in their order."""
    return [float(number) for number in _NUMBER.findall(text)]


def tells(text: str, *runs: Sequence[float | str]) -> bool:
    """True if a text has runs of numbers, each without another number between.

    Args:
        text: in any words.
        runs: of numbers, as they are printed.

    """
    found = numbers_in(text)
    wanted = [[float(number) for number in run] for run in runs]
    return all(
        any(found[i : i + len(run)] == run for i in range(len(found) - len(run) + 1))
        for run in wanted
    )


def mentions(text: str, culprits: str) -> bool:
    """True if a text has some words, with a blank between them, anywhere."""
    return all(word in text for word in culprits.split())
