"""Start, stop and step of a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import floor, isfinite
from numbers import Real

from orchestrator.errors import InputError

#: Orders in which components are stepped; the first is the default.
ORDERS = ("gauss-seidel", "jacobi")

#: A rest of the stop time shorter than this share of a step is a rounding error.
ROUNDING = 1e-9

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
            object.__setattr__(self, name, float(value))
        if not all(isfinite(value) and value > 0.0 for value in (self.stop_time, self.step)):
            raise InputError(
                f"stop time {self.stop_time:g} s and step {self.step:g} s must be positive"
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
        return floor(self.stop_time / self.step * (1.0 + ROUNDING))

    @property
    def has_short_step(self) -> bool:
        """Whether a shorter step follows them."""
        return self.stop_time - self.full_steps * self.step > ROUNDING * self.step

    @property
    def rows(self) -> int:
        """How many rows a complete run has: one at the start, and one a step."""
        return 1 + self.full_steps + self.has_short_step

    def steps(self) -> Iterator[tuple[float, float, float]]:
        """Beginning, length and end of every step [s]: t_k = k h, never accumulated."""
        step = self.step
        t = 0.0
        for k in range(1, self.full_steps + 1):
            end = k * step
            yield t, step, end
            t = end
        if self.has_short_step:
            yield t, self.stop_time - t, self.stop_time
