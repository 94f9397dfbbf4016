"""Numbers and texts as the report prints them."""

from __future__ import annotations

import re
from collections.abc import Sequence


def numbers(values: Sequence[float]) -> str:
    """A few values with three digits."""
    return ", ".join(f"{value:.3g}" for value in values)


def actuator_values(values: Sequence[float], times: str = "") -> str:
    """Values of u, q and r with their units.

    Args:
        values: of the surge force and of the moments of pitch and yaw.
        times: what newtons and newton metres are multiplied by.

    """
    return f"{values[0]:.3g} N{times}; {numbers(values[1:])} N·m{times}"


def plain(text: str) -> str:
    """A text of one line in which Markdown sees no mark."""
    # An underscore within a name is none.
    marks = r"[\\`*{}\[\]<>#|&]|(?<![^\W_])_|_(?![^\W_])"
    return re.sub(marks, r"\\\g<0>", " ".join(text.split()))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown, whose cells are Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def picture(title: str, file: str) -> str:
    """A picture in Markdown that leads to its file in full size."""
    return f"[![{title}]({file})]({file})"
