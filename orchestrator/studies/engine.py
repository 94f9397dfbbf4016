"""A run of a study, what comes out of it, and what an engine is.

There are two engines. One runs the FMUs; it runs any system. The other runs the equations of the
closed loop, compiled, and is some hundred times as fast. Both give the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from orchestrator.master.experiment import ORDERS, Order
from orchestrator.vehicle.signals import ACTUATORS, AXES

#: An error of tracking that counts as having reached the reference [m].
REACHED = 1.0


def _of(name: str, members: Sequence[object]) -> tuple[str, ...]:
    return tuple(f"{name}.{member}" for member in members)


_THETA = range(1, 5)

#: The columns of what comes out of a run, in their order, a number each. Those of metrics.json
#: come first. The others, from the rows of the table (e is y - y_d with the true control point):
#:
#: =====================  ===========================================================
#: `time_to_reach`        the first time at which |e| is at most :data:`REACHED` [s]
#: `late_error`           the largest |e| of the second half of the run [m]
#: `estimate_error`       root mean square of |dy_hat - dy| over the second half, both of
#:                        the same instant [m/s]
#: `theta_hat_half[i]`    the estimate when half of the run is over
#: `theta_hat_end[i]`     and at its end
#: `largest_speed`        of the control point, |dy| [m/s]
#: `largest_drift`        of sway and heave, |(v, w)| [m/s]: Assumption 1
#: =====================  ===========================================================
#:
#: What a system has no ports for, and what is never reached, is not there.
INDICES: tuple[str, ...] = (
    *_of("l2_effort", ACTUATORS),
    *_of("rms_effort", ACTUATORS),
    *_of("peak_command", ACTUATORS),
    *_of("saturated_fraction", ACTUATORS),
    *_of("total_variation", ACTUATORS),
    *_of("final_error", AXES),
    "time_to_reach",
    "late_error",
    "estimate_error",
    *(f"theta_hat_half[{i}]" for i in _THETA),
    *(f"theta_hat_end[{i}]" for i in _THETA),
    "largest_speed",
    "largest_drift",
)


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
        indices: by the names of :data:`INDICES`; none of a run that has failed.
        failure: why the run ended early, or None.

    """

    number: int
    indices: Mapping[str, float]
    failure: str | None = None


class Engine(Protocol):
    """Makes runs.

    It is pickled, and travels to workers with everything that it needs, FMUs included: they share
    no file system with whoever sends it. What is unpacked or compiled on a worker is kept there for
    the runs that follow.

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
