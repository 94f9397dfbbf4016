"""The shape of a component's state, as its type says it: how large it is, and how it is restored.

A state is a NamedTuple of numbers, truth values, text, tuples and NamedTuples, any of which may be
optional. What is of another type is left as it is.
"""

from __future__ import annotations

import sys
from itertools import count
from math import hypot
from typing import Any, Callable, Union, get_args, get_origin, get_type_hints

from fmus.ports.port import Refusal

_SCALARS = (float, int, bool, str, type(None))


def measuring(kind: type) -> Callable[[Any], float]:
    """A function that gives the Euclidean norm of all floats of a state: NaN if one is NaN.

    It runs once a step, and written out it costs a third of a loop.
    """
    names, floats = (f"x{i}" for i in count()), []

    def target(kind: Any) -> str:
        kinds = _elements(kind)
        if kinds is not None:
            return f"({''.join(f'{target(k)}, ' for k in kinds)})"
        name = next(names)
        if kind is float:
            floats.append(name)
        elif kind not in _SCALARS:
            floats.append(f"norm({name})")
        return name

    scope: dict[str, Any] = {"hypot": hypot, "norm": _norm}
    pattern = target(kind)
    norm = f"hypot({', '.join(floats)})" if floats else "0.0"
    text = f"def function(state):\n {pattern} = state\n return {norm}"
    exec(text, scope)
    function: Callable[[Any], float] = scope["function"]
    return function


def _norm(value: Any) -> float:
    if isinstance(value, (list, tuple)):
        return hypot(*map(_norm, value))
    return value if isinstance(value, float) else 0.0


def _elements(kind: Any) -> list[Any] | None:
    """The types of the elements of a tuple that is always of the same length."""
    if isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields"):
        hints = get_type_hints(kind)
        return [hints[name] for name in kind._fields]
    arguments = get_args(kind)
    return [*arguments] if get_origin(kind) is tuple and Ellipsis not in arguments else None


def restored(kind: Any, value: Any) -> Any:
    """A state, or a part of one, as it was before memory or JSON took it.

    Args:
        kind: its type.
        value: it, perhaps with lists in the place of tuples.

    Raises:
        Refusal: it is of another type or length, or not finite.

    """
    kinds = _elements(kind)
    if kinds is not None:
        if not isinstance(value, (list, tuple)) or len(value) != len(kinds):
            raise Refusal(f"{_shown(value)} in the place of {len(kinds)} values")
        made = map(restored, kinds, value)
        return kind._make(made) if hasattr(kind, "_make") else tuple(made)
    if _is_union(kind):
        return _as_one_of(get_args(kind), value)
    if kind is float and type(value) in (float, int):
        if not abs(value) <= sys.float_info.max:
            raise Refusal("a value is not finite")
        return value
    if kind in _SCALARS and type(value) is not kind:
        raise Refusal(f"{_shown(value)} is no {kind.__name__}")
    return frozen(value)


def _is_union(kind: Any) -> bool:
    """Whether a type is `Union[A, B]`, `Optional[A]` or, from Python 3.10, `A | B`."""
    return get_origin(kind) is Union or type(kind).__name__ == "UnionType"


def _as_one_of(kinds: tuple[Any, ...], value: Any) -> Any:
    refusals = []
    for kind in kinds:
        try:
            return restored(kind, value)
        except Refusal as refusal:
            refusals.append(str(refusal))
    raise Refusal(", ".join(refusals))


def frozen(value: Any) -> Any:
    """Lists, as JSON gives them, back to the tuples that states are made of."""
    return tuple(map(frozen, value)) if isinstance(value, (list, tuple)) else value


def _shown(value: Any) -> str:
    return f"{value!r:.40}"
