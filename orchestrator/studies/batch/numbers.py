"""All numbers of nested tuples, and sums over them.

For numba each function is an expression that is written out for each type; sums are trees, whose
branches a processor computes side by side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def flat(value: Any) -> tuple[float, ...]:
    """The numbers of a tuple of numbers and tuples, in their order."""
    if isinstance(value, tuple):
        return tuple(number for part in value for number in flat(part))
    return (value,)


def square(value: Any) -> float:
    """The sum of their squares."""
    return sum(x * x for x in flat(value))


def nought(value: Any) -> float:
    """Zero, if all of them are finite; if not, no number."""
    return sum(0.0 * x for x in flat(value))


def overload_all() -> None:
    """Have numba know them."""
    from numba import types  # noqa: PLC0415
    from numba.extending import overload  # noqa: PLC0415

    def places(kind: Any, place: str) -> list[str]:
        parts: Any = kind if isinstance(kind, types.BaseTuple) else None
        if parts is None:
            return [place]
        return [one for i, part in enumerate(parts) for one in places(part, f"{place}[{i}]")]

    def written_out(function: Callable[[Any], Any], text: Callable[[list[str]], str]) -> None:
        overload(function)(lambda value: eval(f"lambda value: {text(places(value, 'value'))}"))

    written_out(flat, lambda xs: f"({', '.join(xs)},)")
    written_out(square, lambda xs: _tree([f"{x} * {x}" for x in xs]))
    written_out(nought, lambda xs: _tree([f"0.0 * {x}" for x in xs]))


def _tree(terms: list[str]) -> str:
    """A sum as a tree."""
    half = len(terms) // 2
    return f"({_tree(terms[:half])} + {_tree(terms[half:])})" if half else terms[0]
