"""All numbers of nested tuples, one behind the other."""

from __future__ import annotations

from typing import Any


def flat(value: Any) -> tuple[float, ...]:
    """The numbers of a tuple of numbers and tuples, in their order."""
    if isinstance(value, tuple):
        return tuple(number for part in value for number in flat(part))
    return (value,)


def overload_flat() -> None:
    """Have numba take it as an expression that is written out for each type."""
    from numba import types  # noqa: PLC0415
    from numba.extending import overload  # noqa: PLC0415

    def places(kind: Any, place: str) -> str:
        parts: Any = kind if isinstance(kind, types.BaseTuple) else None
        if parts is None:
            return f"{place}, "
        return "".join(places(part, f"{place}[{i}]") for i, part in enumerate(parts))

    overload(flat)(lambda value: eval(f"lambda value: ({places(value, 'value')})"))
