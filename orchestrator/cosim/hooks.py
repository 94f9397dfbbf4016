"""Hooks, which act on a run between two of its steps: inputs that follow a table, and a clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import c_double
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from math import ceil, isfinite, log
from time import monotonic, sleep
from typing import Any, Protocol, runtime_checkable

import numpy as np

# Imported by name: an FMU in Python may change the module.
from numpy import isfinite as are_finite

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.experiment import MOST_STEPS, Experiment
from orchestrator.cosim.fmi.instance import Instance, Log
from orchestrator.cosim.observers import Blocks, Occurrence
from orchestrator.cosim.row import Overrides, Row
from orchestrator.cosim.stages import LinkedStage, make_stages
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import Value
from orchestrator.machine.errors import InputError
from orchestrator.machine.interrupts import Interrupts

#: A number of steps that no run reaches.
NEVER = MOST_STEPS + 1


@dataclass
class Run:
    """A run and its progress.

    Attributes:
        system, experiment: of the run.
        instances: of its components, by name.
        row: of all values.
        stages: of every step.
        passing: stages in which values of t_k pass before the row shows them, and before the step;
            None: the row is shown after the step.
        overrides: changes to values on their way from outputs to inputs.
        blocks: take the rows.
        log: messages of the FMUs.
        interrupts: signals that have arrived; a hook that waits looks there.
        hooks: that act on the run.
        made: number of steps that have been made.
        due: number of steps after which a hook acts; every loop stops there.
        until: number of steps after which the loop stops.
        happened: events, in their order.

    """

    system: System
    experiment: Experiment
    instances: Mapping[str, Instance]
    row: Row
    stages: Sequence[LinkedStage]
    passing: Sequence[LinkedStage] | None
    overrides: Overrides
    blocks: Blocks
    log: Log
    interrupts: Interrupts
    hooks: Sequence[Hook] = ()
    made: int = 0
    due: int = 0
    until: int = NEVER
    happened: list[Occurrence] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make all hooks due before the first step."""
        # By place: two hooks may be equal, or not hashable.
        self.dues = [0] * len(self.hooks)

    def call_hooks(self) -> None:
        """Call the hooks that are due, in their order, and find when the next one is."""
        for i, hook in enumerate(self.hooks):
            if self.dues[i] <= self.made:
                self.dues[i] = hook.act(self)
        self.due = min(self.dues, default=NEVER)

    @property
    def time(self) -> float:
        """Time that the components have reached [s]."""
        return self.experiment.time(self.made)

    def pass_on(self) -> None:
        """Let values of the present time pass, where a row shows them before the step."""
        experiment, k = self.experiment, self.made
        make_stages(
            self.passing or (), self.row.values, experiment, experiment.rows - 1,
            k, c_double(self.time), c_double(experiment.length(k, 1)),
        )  # fmt: skip

    @contextmanager
    def ahead(self) -> Iterator[None]:
        """Enter a context with the row as it will be shown, and restore it afterwards."""
        before = self.row.values.copy()
        self.pass_on()
        yield
        self.row.values[:] = before

    def refresh(self, component: str) -> None:
        """Update the inputs of a component from their present sources."""
        targets = [self.row.columns[wire.target] for wire in self.system.feeding[component]]
        with self.ahead():
            self.overrides.refresh(component)
            taken = self.row.values[targets]
        self.row.values[targets] = taken

    def show(self) -> None:
        """Complete the last row, which no step follows, and keep it if it is finite."""
        if self.blocks.count == self.made:
            self.pass_on()
            if are_finite(self.row.shown).all():
                self.blocks.append(self.time, self.row.shown)


class Hook(Protocol):
    """Acts on a run between two of its steps: events, a checkpoint, a clock."""

    def act(self, run: Run) -> int:
        """Act after :attr:`Run.made` steps, for the first time before any.

        In a resumed run the first call comes after the steps that were made before, in any case.

        Returns:
            The number of steps after which to call it again; :data:`NEVER`: not again.

        Raises:
            Ended: the run is to end here.
            ComponentFailed: a component has failed.

        """


@runtime_checkable
class Stateful(Protocol):
    """Keeps a state that a resumed run needs.

    Such a hook remembers what it has done and still has to do.
    """

    def state(self) -> Any:
        """Return the state as JSON."""

    def restore(self, state: Any) -> None:
        """Restore the state."""


def stateful(run: Run) -> list[Stateful]:
    """Return the parts of a run with a state, besides its FMUs and its row."""
    hooks = [hook for hook in run.hooks if isinstance(hook, Stateful)]
    return [run.row.strings, run.overrides, run.log, *hooks]


#: Time on the clock between two looks at it, in steps [s].
_GRAIN = 1e-3

#: Interval at which a wait checks for interrupts and for rows to hand over [s].
_GLANCE = 0.02

#: Relative width of the classes in which latenesses are counted, and the end of the first class
#: [s]: a percentile has that precision.
_RESOLUTION, _FIRST = 0.01, 1e-7

#: Share of the latenesses below the recorded percentile.
_SHARE = 0.99


@dataclass(frozen=True)
class InputTable:
    """Values of some inputs over time.

    Attributes:
        targets: inputs that nothing feeds.
        times: increasing [s].
        values: of each input at each time, (times, targets).
        linear: True for inputs that are interpolated linearly; the others keep a value until the
            next.
        exact: columns of texts and of integers of 64 bits, by place; `values` has zeros there.

    """

    targets: tuple[PortName, ...]
    times: np.ndarray
    values: np.ndarray
    linear: np.ndarray
    exact: Mapping[int, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        targets: tuple[PortName, ...],
        times: np.ndarray,
        columns: Sequence[np.ndarray],
        linear: Sequence[bool],
    ) -> InputTable:
        """Make a table of columns, each in its type."""
        exact = {place: column for place, column in enumerate(columns) if column.dtype.kind != "f"}
        nothing = np.zeros(len(times))
        values = [nothing if place in exact else column for place, column in enumerate(columns)]
        return cls(targets, times, np.column_stack(values), np.array(linear), exact)

    @property
    def digest(self) -> str:
        """Digest that differs for other values."""
        names = " ".join(map(str, self.targets)).encode()
        arrays = (self.times, self.values, self.linear, *self.exact.values())
        return sha256(names + b"".join(array.tobytes() for array in arrays)).hexdigest()

    def at(self, time: float, row: int) -> list[Value]:
        """Return the values at a time [s]; `row` is the last row at or before it."""
        row = max(row, 0)
        here, following = self.values[row], self.values[min(row + 1, len(self.values) - 1)]
        length = self.times[min(row + 1, len(self.times) - 1)] - self.times[row]
        passed = min(max(time - self.times[row], 0.0) / length, 1.0) if length else 0.0
        if self._is_steep:
            line = (1.0 - passed) * here + passed * following
        else:
            line = here + passed * (following - here)
        between: list[Value] = np.where(self.linear, line, here).tolist()
        for place, column in self.exact.items():
            between[place] = column[row].item()
        return between

    def playback(self) -> Playback:
        """Return a hook that supplies the inputs with these values."""
        return Playback(self)

    @cached_property
    def _is_steep(self) -> bool:
        """True if the difference of two successive values is too large for a double."""
        with np.errstate(over="ignore"):
            return not np.isfinite(np.diff(self.values, axis=0)).all()


class Playback:
    """A hook that supplies inputs with the values of a table at the beginning of each step.

    Before the first time of the table inputs have the first values, after the last time the last
    ones.
    """

    def __init__(self, input_table: InputTable) -> None:
        """Take the table."""
        self._input_table = input_table
        self._steps = np.empty(0, dtype=int)

    def act(self, run: Run) -> int:
        """Supply the present values."""
        input_table = self._input_table
        if not len(self._steps):
            self._steps = np.array([run.experiment.reaching(time) for time in input_table.times])
        row = int(np.searchsorted(self._steps, run.made, side="right")) - 1
        for target, value in zip(input_table.targets, input_table.at(run.time, row), strict=True):
            run.overrides.supply(target, value)
        if row + 1 == len(self._steps):
            return NEVER
        return run.made + 1 if input_table.linear.any() else int(self._steps[row + 1])


class Lateness:
    """Statistics of how late steps are, without a list."""

    def __init__(self) -> None:
        """Start empty."""
        self._n, self._sum, self._worst = 0, 0.0, 0.0
        self._counts: Counter[int] = Counter()

    def take(self, seconds: float) -> None:
        """Count a lateness [s]."""
        self._n += 1
        self._sum += seconds
        self._worst = max(self._worst, seconds)
        self._counts[ceil(log(max(seconds, _FIRST) / _FIRST) / log(1.0 + _RESOLUTION))] += 1

    @property
    def mean(self) -> float:
        """Mean [s]; zero if there is none."""
        return self._sum / max(self._n, 1)

    @property
    def percentile(self) -> float:
        """Value that 99 % of the latenesses do not exceed [s], at most a hundredth too large."""
        left = _SHARE * self._n
        for place, n in sorted(self._counts.items()):
            left -= n
            if left <= 0.0:
                return min(_FIRST * (1.0 + _RESOLUTION) ** place, self._worst)
        return self._worst

    @property
    def worst(self) -> float:
        """Maximum [s]."""
        return self._worst


class RealTime:
    """A hook that makes a run wait for a clock, and measures how late it is.

    A late run catches up as fast as it can: the clock runs from the first step on.

    Attributes:
        factor: simulated seconds per second.
        lateness: of the steps after which the clock was read.

    """

    @staticmethod
    def check(factor: float) -> None:
        """Check a factor before a run.

        Raises:
            InputError: it is not positive and finite.

        """
        if not (isfinite(factor) and factor > 0.0):
            raise InputError(f"real time x {factor:g}: the factor must be positive and finite")

    def __init__(self, factor: float) -> None:
        """Limit the speed to simulated seconds per second."""
        self.factor = factor
        self.lateness = Lateness()
        self._origin: float | None = None

    def act(self, run: Run) -> int:
        """Wait until the clock has reached the time of the run."""
        now = monotonic()
        if self._origin is None:
            # A resumed run does not begin at the start.
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
        """Return the statistics for the record of the run [s]."""
        late = self.lateness
        return {
            "factor": self.factor,
            "late_mean": late.mean,
            "late_percentile_99": late.percentile,
            "late_worst": late.worst,
        }

    def __str__(self) -> str:
        """Describe the statistics in one line."""
        late = self.lateness
        mean, percentile, worst = (
            f"{1e3 * seconds:.3g} ms" for seconds in (late.mean, late.percentile, late.worst)
        )
        return (
            f"real time x {self.factor:g}: steps {mean} late on average, {percentile} at the 99th "
            f"percentile, {worst} at worst"
        )
