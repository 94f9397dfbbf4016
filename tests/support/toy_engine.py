"""An engine whose runs are easily made, and behave as badly as their parameters say."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

from orchestrator.studies.columns import Outcome, Outcomes, Point, Points


class Toy(NamedTuple):
    """Squares `toy.x` of a run, and says which process did it.

    Attributes:
        seconds: that a run takes, unless it says itself what `toy.seconds` is.

    """

    seconds: float = 0.0
    least_runs: int = 1
    most_runs: int = 10_000

    def outcomes(self, points: Points) -> Iterator[Outcomes]:
        for point in points:
            time.sleep(point.parameters.get("toy.seconds", self.seconds))
            if point.parameters.get("toy.talks"):
                os.write(1, b"out of a run\n")
                os.write(2, b"out of a run\n")
            if point.parameters.get("toy.fatal"):
                os.kill(os.getpid(), signal.SIGKILL)
            yield Outcomes.of([outcome(point, os.getpid())])


def outcome(point: Point, process: int = 0) -> Outcome:
    """Outcome of a run."""
    return Outcome(point.number, {"square": point.parameters["toy.x"] ** 2, "process": process})


def run(number: int, parameters: Mapping[str, Any] = {}) -> Point:
    """A run of a second's steps."""
    return Point(number, "toy", {"toy.x": 0.1 * number, **parameters}, 1.0, 0.02)


def many(points: Iterable[Point], n: int = 8) -> Iterator[Points]:
    """Runs, some at a time."""
    every = iter(points)
    while some := [*islice(every, n)]:
        yield Points.of(some)


def numbers_and_squares(blocks: Iterable[Iterable[Outcome]]) -> list[tuple[int, Any]]:
    """Outcomes of runs, in their order."""
    return sorted((made.number, made.indices.get("square")) for block in blocks for made in block)


def expected(points: Iterable[Point]) -> list[tuple[int, Any]]:
    """Expected outcomes."""
    return [(point.number, outcome(point).indices["square"]) for point in points]
