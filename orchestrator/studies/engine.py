"""A run of a study, what comes out of it, and what an engine is.

There are two engines. One runs the FMUs; it runs any system. The other runs the equations of the
closed loop, compiled, and is some hundred times as fast. Both give the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from orchestrator.master.experiment import ORDERS, Order


class Point(NamedTuple):
    """One run of a study.

    Attributes:
        number: within the study, from 0.
        scenario: name or path.
        parameters: what it changes, by `component.parameter`, with the scenario's own left out.
        stop_time, step: of the experiment [s].
        order: of evaluation.

    """

    number: int
    scenario: str
    parameters: Mapping[str, Any]
    stop_time: float
    step: float
    order: Order = ORDERS[0]


class Outcome(NamedTuple):
    """What comes out of a run.

    Attributes:
        number: of the run.
        indices: by their columns, :func:`.index_columns`; none of a run that has failed.
        failure: why the run ended early, or None.

    """

    number: int
    indices: Mapping[str, float]
    failure: str | None = None


class Engine(Protocol):
    """Makes runs.

    It is pickled, and travels to workers with everything that it needs, FMUs included: they share
    no file system with the process that sends it. What is unpacked or compiled on a worker is kept
    there for the runs that follow.

    Attributes:
        digest: of what the numbers depend on besides the identities of what is run.

    """

    @property
    def digest(self) -> str:
        """A text in hexadecimal digits."""
        ...

    def outcomes(self, runs: Sequence[Point]) -> Iterator[Outcome]:
        """Make some runs, in their order.

        Args:
            runs: of the study that the engine was made for.

        """
        ...
