"""Times, steps, order and coupling of a run; communication points are t_k = k h."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, floor, isfinite, ulp
from numbers import Real
from typing import ClassVar, Literal, TypeAlias, cast, get_args

from orchestrator.machine.errors import InputError

#: Orders in which values pass and components are stepped. The default is the first where the FMUs
#: allow it, else the second.
OrderName: TypeAlias = Literal["feedthrough", "gauss-seidel", "jacobi"]

#: An order by name, or the names of all components, stepped one after the other.
Order: TypeAlias = OrderName | list[str] | tuple[str, ...]

#: A rest of a run shorter than this share of a step is a rounding error.
_MOST_OF_A_STEP = 1e-3

#: More steps than this are refused as a mistake.
MOST_STEPS = 1_000_000_000


@dataclass(frozen=True)
class Exchange:
    """The exchange of values between components; the default is ours, other tools differ.

    Attributes:
        initial: one of `INITIAL`.
        groups: all components, in groups that are stepped side by side. Each group takes all
            outputs that the groups before it have just computed, not only those with direct
            feedthrough, and rings are delayed. Empty: the experiment's order.

    """

    initial: str = "full"
    groups: Sequence[Sequence[str]] = ()

    #: Inputs of components in the first step: outputs exchanged in initialisation mode (ours),
    #: outputs exchanged after it, or start values and zeros.
    INITIAL: ClassVar[tuple[str, ...]] = ("full", "none", "zero")


FULL, NONE, ZERO = Exchange.INITIAL

#: The default.
OURS = Exchange()


@dataclass(frozen=True)
class Experiment:
    """Times, step, order and coupling of a run.

    Attributes:
        stop_time: end [s]; the last step is shorter if the run is not a multiple of the step.
        step: communication step [s].
        order: one of `ORDERS`, or the names of all components, one stepped after the other;
            None: `feedthrough` where the outputs of the FMUs follow their inputs between steps,
            else `gauss-seidel`.
        start_time: start [s].
        coupling: one of `COUPLINGS`; None: rings are solved where their FMUs allow it, else
            delayed.

    """

    stop_time: float
    step: float
    order: Order | None = None
    start_time: float = 0.0
    coupling: str | None = None

    #: Ways to close rings of direct feedthroughs: solve them, open them by a delay of a step, or
    #: solve them with inputs that change linearly from one communication point to the next.
    Coupling = Literal["solve", "delay", "linear"]

    #: Names of orders and couplings.
    ORDERS: ClassVar[tuple[OrderName, ...]] = get_args(OrderName)
    COUPLINGS: ClassVar[tuple[Coupling, ...]] = get_args(Coupling)

    #: A smaller relative difference of two times is a rounding error.
    ROUNDING: ClassVar[float] = 1e-9

    @staticmethod
    def read_order(text: str) -> Order:
        """Read an order of a command line: one of `ORDERS`, or names with commas."""
        if "," in text:
            return tuple(name.strip() for name in text.split(","))
        # The experiment refuses any other name.
        return cast(OrderName, text)

    @staticmethod
    def format_order(order: Order | None) -> str:
        """Write an order for a command line; empty: no order is stated."""
        return order if isinstance(order, str) else ",".join(order or ())

    def __post_init__(self) -> None:
        """Refuse times, steps, orders and couplings that cannot be run."""
        for name in ("start_time", "stop_time", "step"):
            value = getattr(self, name)
            if not isinstance(value, Real) or isinstance(value, bool):
                raise InputError(f"times and step must be numbers, not {value!r}")
            # JSON has no numbers of numpy.
            try:
                object.__setattr__(self, name, float(value))
            except OverflowError:
                raise InputError("times and step must be smaller than 1e308 s") from None
        self.check_step(self.step)
        if self.coupling not in (None, *self.COUPLINGS):
            raise InputError(f"coupling {self.coupling!r}: use one of {', '.join(self.COUPLINGS)}")
        if self.coupling == LINEAR and self.order not in (None, GAUSS_SEIDEL, JACOBI):
            raise InputError("coupling linear steps all components at once: leave out the order")
        if self.order is None:
            return
        if not isinstance(self.order, str):
            object.__setattr__(self, "order", tuple(self.order))
        elif self.order not in self.ORDERS:
            raise InputError(
                f"order {self.order!r}: use one of {', '.join(self.ORDERS)}, or name every "
                "component"
            )

    def check_step(self, step: float) -> None:
        """Check that the run can be made in steps of a length [s].

        Raises:
            InputError: it cannot.

        """
        if not (isfinite(step) and step > 0.0):
            raise InputError(f"step {step:g} s must be positive, and finite")
        if not (isfinite(self._length) and self._length > 0.0):
            than = f"after the start time, {self.start_time:g} s" if self.start_time else "positive"
            raise InputError(f"stop time {self.stop_time:g} s must be {than}, and finite")
        if self._length / step > MOST_STEPS:
            raise InputError(
                f"{self._length:g} s in steps of {step:g} s are more than {MOST_STEPS:,} steps"
            )

    @property
    def _length(self) -> float:
        """Duration [s]."""
        return self.stop_time - self.start_time

    @property
    def acting_row(self) -> int:
        """Row with the values that act in a step: at its beginning (0) or at its end (1).

        All inputs act, and the outputs that follow from inputs of the same time. In feedthrough
        order they pass before the row shows them; in other orders the step computes them.
        """
        return 0 if self.order in (None, FEEDTHROUGH) else 1

    @property
    def full_steps(self) -> int:
        """Number of steps of full length."""
        return floor(self._in_steps)

    @property
    def has_short_step(self) -> bool:
        """True if a shorter step follows them."""
        return self._in_steps > self.full_steps

    @property
    def _in_steps(self) -> float:
        """Duration in steps; a whole number where only rounding makes the difference."""
        return _in_steps(self._length, self.step)

    def reaching(self, time: float) -> int:
        """Return the number of steps to the first t_k at or after a time [s]."""
        # The number may exceed what an integer can hold.
        steps = min(max((time - self.start_time) / self.step, 0.0), MOST_STEPS + 1.0)
        return ceil(_rounded(steps))

    @property
    def rows(self) -> int:
        """Number of rows of a complete run: one at the start, and one a step."""
        return 1 + self.full_steps + self.has_short_step

    def time(self, k: int) -> float:
        """Return the time after k steps [s]."""
        return self.start_time + k * self.step if k <= self.full_steps else self.stop_time

    def length(self, k: int, n: int) -> float:
        """Return the length of the n steps after the k-th, or of as many as are left [s]."""
        if k + n > self.full_steps and self.has_short_step:
            return self.stop_time - self.time(k)
        return (min(k + n, self.full_steps) - k) * self.step

    def steps(self, made: int = 0) -> Iterator[tuple[int, float, float, float]]:
        """Yield number, beginning, length and end of every step [s].

        The end is t_k = t_0 + k h, which is never accumulated.

        Args:
            made: number of steps that have been made already.

        """
        start, step, t = self.start_time, self.step, self.time(made)
        for k in range(made + 1, self.full_steps + 1):
            end = start + k * step
            yield k, t, step, end
            t = end
        if self.has_short_step and made < self.rows - 1:
            yield self.rows - 1, t, self.stop_time - t, self.stop_time


#: The names one by one.
FEEDTHROUGH, GAUSS_SEIDEL, JACOBI = Experiment.ORDERS
SOLVE, DELAY, LINEAR = Experiment.COUPLINGS


# Studies ask repeatedly.
@lru_cache
def _in_steps(length: float, step: float) -> float:
    # A run is not empty, however small its share of a step.
    return _rounded(max(length / step, ulp(0.0)))


def _rounded(n: float) -> float:
    """Return a number of steps; a whole number where only rounding makes the difference."""
    nearest = round(n)
    return nearest if abs(n - nearest) <= min(Experiment.ROUNDING * nearest, _MOST_OF_A_STEP) else n
