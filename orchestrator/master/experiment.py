"""Start, stop and step of a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import floor, isfinite, ulp
from numbers import Real

from orchestrator.errors import InputError

#: Orders in which components are stepped; the first is the default.
ORDERS = ("gauss-seidel", "jacobi")

#: A rest shorter than this share of the run, and than that of a step, is a rounding error.
ROUNDING, _MOST_OF_A_STEP = 1e-9, 1e-3

#: More steps than this are taken for a mistake.
MOST_STEPS = 1_000_000_000


@dataclass(frozen=True)
class Experiment:
    """What to run a system for, from t = 0.

    Attributes:
        stop_time: end [s]; the last step is shorter if it is no multiple of the step.
        step: communication step [s].
        order: in which components are stepped, one of :data:`ORDERS`.

    """

    stop_time: float
    step: float
    order: str = ORDERS[0]

    def __post_init__(self) -> None:
        """Refuse what cannot be run."""
        for name in ("stop_time", "step"):
            value = getattr(self, name)
            if not isinstance(value, Real) or isinstance(value, bool):
                raise InputError(f"stop time and step must be numbers, not {value!r}")
            # numpy's numbers do not go into JSON.
            try:
                object.__setattr__(self, name, float(value))
            except OverflowError:
                raise InputError("stop time and step must be smaller than 1e308 s") from None
        if not all(isfinite(value) and value > 0.0 for value in (self.stop_time, self.step)):
            raise InputError(
                f"stop time {self.stop_time:g} s and step {self.step:g} s must be positive, and "
                "finite"
            )
        if self.stop_time / self.step > MOST_STEPS:
            raise InputError(
                f"{self.stop_time:g} s in steps of {self.step:g} s are more than "
                f"{MOST_STEPS:,} steps"
            )
        if self.order not in ORDERS:
            raise InputError(f"order {self.order!r}: use one of {', '.join(ORDERS)}")

    @property
    def full_steps(self) -> int:
        """How many steps have the whole length."""
        return floor(self._in_steps)

    @property
    def has_short_step(self) -> bool:
        """Whether a shorter step follows them."""
        return self._in_steps > self.full_steps

    @property
    def _in_steps(self) -> float:
        """The stop time in steps; a whole number where it is one but for rounding."""
        # However small its share of a step, a run is not empty.
        n = max(self.stop_time / self.step, ulp(0.0))
        nearest = round(n)
        return nearest if abs(n - nearest) <= min(ROUNDING * nearest, _MOST_OF_A_STEP) else n

    @property
    def rows(self) -> int:
        """How many rows a complete run has: one at the start, and one a step."""
        return 1 + self.full_steps + self.has_short_step

    def time(self, k: int) -> float:
        """The time after k steps [s]."""
        return k * self.step if k <= self.full_steps else self.stop_time

    def steps(self, made: int = 0) -> Iterator[tuple[int, float, float, float]]:
        """Number, beginning, length and end of every step [s]: t_k = k h, never accumulated.

        Args:
            made: how many steps have been made.

        """
        step, t = self.step, self.time(made)
        for k in range(made + 1, self.full_steps + 1):
            end = k * step
            yield k, t, step, end
            t = end
        if self.has_short_step and made < self.rows - 1:
            yield self.rows - 1, t, self.stop_time - t, self.stop_time
