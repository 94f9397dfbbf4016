"""A run that goes no faster than a clock."""

from __future__ import annotations

from collections import Counter
from math import ceil, isfinite, log
from time import monotonic, sleep

from orchestrator.machine.errors import InputError
from orchestrator.master.hooks.hook import NEVER, Run

#: The clock is looked at after as many steps as take so long by it [s].
_GRAIN = 1e-3

#: How often a wait checks whether the run is to stop, or rows are due [s].
_GLANCE = 0.02

#: Latenesses are counted in classes that are so much longer one than the other, from the first on
#: [s]: a percentile is known to that share.
_RESOLUTION, _FIRST = 0.01, 1e-7

#: The share of the latenesses that is said to be below a percentile.
_SHARE = 0.99


class Lateness:
    """How late something was, again and again, without a list of it."""

    def __init__(self) -> None:
        """Start with none."""
        self._n, self._sum, self._worst = 0, 0.0, 0.0
        self._counts: Counter[int] = Counter()

    def take(self, seconds: float) -> None:
        """Take one into account [s]."""
        self._n += 1
        self._sum += seconds
        self._worst = max(self._worst, seconds)
        self._counts[ceil(log(max(seconds, _FIRST) / _FIRST) / log(1.0 + _RESOLUTION))] += 1

    @property
    def mean(self) -> float:
        """Of all of them [s]; zero if there was none."""
        return self._sum / max(self._n, 1)

    @property
    def percentile(self) -> float:
        """What 99 % of them do not exceed [s], at most a hundredth too long."""
        left = _SHARE * self._n
        for place, n in sorted(self._counts.items()):
            left -= n
            if left <= 0.0:
                return min(_FIRST * (1.0 + _RESOLUTION) ** place, self._worst)
        return self._worst

    @property
    def worst(self) -> float:
        """The longest of them [s]."""
        return self._worst


def check_factor(factor: float) -> None:
    """Check before a run that a clock can set its pace.

    Raises:
        InputError: it cannot.

    """
    if not (isfinite(factor) and factor > 0.0):
        raise InputError(f"real time x {factor:g}: the factor must be positive and finite")


class RealTime:
    """A hook that makes a run wait for a clock, and measures by how much it is late.

    A run that is late makes up for it as fast as it can: times are one clock's, from the
    first step on.

    Attributes:
        factor: simulated seconds in a second.
        lateness: of the steps whose time the clock was asked for.

    """

    def __init__(self, factor: float) -> None:
        """Run as many simulated seconds in a second."""
        self.factor = factor
        self.lateness = Lateness()
        self._origin: float | None = None

    def act(self, run: Run) -> int:
        """Wait until the clock has come to the time of the run."""
        now = monotonic()
        if self._origin is None:
            # A run that is resumed begins somewhere.
            self._origin = now - run.time / self.factor
        else:
            self._wait(run, self._origin + run.time / self.factor)
        last = run.experiment.rows - 1
        if run.made >= last:
            return NEVER
        return min(run.made + ceil(_GRAIN * self.factor / run.experiment.step), last)

    def _wait(self, run: Run, due: float) -> None:
        while (left := due - monotonic()) > 0.0:
            if run.interrupts:
                return
            if monotonic() > run.blocks.due:
                run.blocks.hand_over()
            sleep(min(left, _GLANCE))
        self.lateness.take(monotonic() - due)

    def record(self) -> dict[str, float]:
        """How well it went, for the record of the run [s]."""
        late = self.lateness
        return {
            "factor": self.factor,
            "late_mean": late.mean,
            "late_percentile_99": late.percentile,
            "late_worst": late.worst,
        }

    def __str__(self) -> str:
        """How well it went, in words."""
        late = self.lateness
        mean, percentile, worst = (
            f"{1e3 * seconds:.3g} ms" for seconds in (late.mean, late.percentile, late.worst)
        )
        return (
            f"real time x {self.factor:g}: late by {mean} on average, {percentile} at the 99th "
            f"percentile, {worst} at worst"
        )
