"""What happens to a value on its way through a connection."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TypeAlias

from orchestrator.errors import InputError


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
        InputError: one is linear, and the other a table, or no number holds what they come to.

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
        sources = dict.fromkeys(source for table in (first, then) for source, _ in table.pairs)
        return Mapped(tuple((source, then(first(source))) for source in sources))
    raise InputError("a linear transformation and a mapping of single values follow each other")
