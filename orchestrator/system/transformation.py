"""What happens to a value on its way through a connection."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True)
class Linear:
    """The target takes factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Mapped:
    """The target takes what stands beside the source's value; another value ends the run.

    Attributes:
        pairs: values of source and target, truth values as zero and one.

    """

    pairs: tuple[tuple[float, float], ...]


Transformation: TypeAlias = Linear | Mapped
