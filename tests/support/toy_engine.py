"""An engine whose runs are easily made, and behave as badly as their parameters say."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from orchestrator.studies.engine import Outcome, Point


class Toy(NamedTuple):
    """Squares `toy.x` of a run, and says which process did it.

    Attributes:
        seconds: that a run takes, unless it says itself what `toy.seconds` is.

    """

    seconds: float = 0.0

    def outcomes(self, points: Sequence[Point]) -> Iterator[Outcome]:
        for point in points:
            time.sleep(point.parameters.get("toy.seconds", self.seconds))
            if point.parameters.get("toy.talks"):
                os.write(1, b"out of a run\n")
                os.write(2, b"out of a run\n")
            if point.parameters.get("toy.fatal"):
                os.kill(os.getpid(), signal.SIGKILL)
            yield outcome(point, os.getpid())


def outcome(point: Point, process: int = 0) -> Outcome:
    """Outcome of a run."""
    return Outcome(point.number, {"square": point.parameters["toy.x"] ** 2, "process": process})


def run(number: int, parameters: Mapping[str, Any] = {}) -> Point:
    """A run of a second's steps."""
    return Point(number, "toy", {"toy.x": 0.1 * number, **parameters}, 1.0, 0.02)


def numbers_and_squares(blocks: Iterable[Sequence[Outcome]]) -> list[tuple[int, Any]]:
    """Outcomes of runs, in their order."""
    return sorted((made.number, made.indices.get("square")) for block in blocks for made in block)


def expected(points: Iterable[Point]) -> list[tuple[int, Any]]:
    """Expected outcomes."""
    return [(point.number, outcome(point).indices["square"]) for point in points]
