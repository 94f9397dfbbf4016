"""What happens to a value on its way through a connection."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TypeAlias

from orchestrator.machine.errors import InputError

#: Values of a mapping that is made of several.
_MOST_PAIRS = 1000


@dataclass(frozen=True)
class Linear:
    """The target takes factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: float) -> float:
        """The value that arrives."""
        return self.factor * value + self.offset


@dataclass(frozen=True)
class Mapped:
    """The target takes what stands beside the source's value; any other value stays as it is.

    Attributes:
        pairs: values of source and target, truth values as zero and one.

    """

    pairs: tuple[tuple[float, float], ...]

    def __call__(self, value: float) -> float:
        """The value that arrives."""
        return dict(self.pairs).get(value, value)


Transformation: TypeAlias = Linear | Mapped


def chained(first: Transformation | None, then: Transformation | None) -> Transformation | None:
    """Two transformations, one after the other, as one; None leaves a value as it is.

    Raises:
        InputError: one is linear, and the other a table; no number holds what they come to; or
            together they are too long a table.

    """
    # One that says that nothing happens is kept where there is no other.
    for nothing in (None, Linear()):
        if first == nothing:
            return then
        if then == nothing:
            return first
    if isinstance(first, Linear) and isinstance(then, Linear):
        both = Linear(then.factor * first.factor, then(first.offset))
        vanishes = not both.factor and first.factor and then.factor
        if vanishes or not (isfinite(both.factor) and isfinite(both.offset)):
            raise InputError(
                f"linear transformations follow each other that come to the factor "
                f"{both.factor:g} and the offset {both.offset:g}"
            )
        return both
    if isinstance(first, Mapped) and isinstance(then, Mapped):
        before, after = dict(first.pairs), dict(then.pairs)
        sources = {**before, **after}
        if len(sources) > _MOST_PAIRS:
            raise InputError(f"mappings of more than {_MOST_PAIRS:,} values follow each other")
        passed = ((source, before.get(source, source)) for source in sources)
        return Mapped(tuple((source, after.get(value, value)) for source, value in passed))
    raise InputError("a linear transformation and a mapping of single values follow each other")
