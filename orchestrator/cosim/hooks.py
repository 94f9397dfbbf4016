"""Hooks act on a run between two of its steps: inputs that follow a table, and a clock."""

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

# By name: an FMU in Python may change what the module holds.
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

#: After more steps than any run has.
NEVER = MOST_STEPS + 1


@dataclass
class Run:
    """A run, as far as it has come.

    Attributes:
        system, experiment: of the run.
        instances: of its components, by their names.
        row: of all values.
        stages: of every step.
        passing: in which values of t_k pass before the row shows them, and the step; None: the row
            is shown after the step.
        overrides: what is done to values on their way from outputs to inputs.
        blocks: take the rows.
        log: of what the FMUs say.
        interrupts: signals to stop that have come; a hook that waits looks there.
        hooks: what acts on it.
        made: how many steps have been made.
        due: after how many a hook acts on it: every loop stops there.
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
    due: int = NEVER
    happened: list[Occurrence] = field(default_factory=list)

    @property
    def time(self) -> float:
        """What the components have come to [s]."""
        return self.experiment.time(self.made)

    def pass_on(self) -> None:
        """Let values of now pass, where a row shows them before the step."""
        experiment, k = self.experiment, self.made
        make_stages(
            self.passing or (), self.row.values, experiment, experiment.rows - 1,
            k, c_double(self.time), c_double(experiment.length(k, 1)),
        )  # fmt: skip

    @contextmanager
    def ahead(self) -> Iterator[None]:
        """Have the row as it is shown if nothing more happens now, and then as it was."""
        before = self.row.values.copy()
        self.pass_on()
        yield
        self.row.values[:] = before

    def refresh(self, component: str) -> None:
        """Let the inputs of a component take at once what feeds them now."""
        targets = [self.row.columns[wire.target] for wire in self.system.feeding[component]]
        with self.ahead():
            self.overrides.refresh(component)
            taken = self.row.values[targets]
        self.row.values[targets] = taken

    def show(self) -> None:
        """Complete the row of now, which no step follows, and keep it if it is finite."""
        if self.blocks.count == self.made:
            self.pass_on()
            if are_finite(self.row.shown).all():
                self.blocks.append(self.time, self.row.shown)


class Hook(Protocol):
    """Acts on a run between two of its steps: events, a checkpoint, a clock."""

    def act(self, run: Run) -> int:
        """Act after :attr:`Run.made` steps, for the first time before any.

        Where a run is resumed, the first call comes after the steps that were made before, whether
        it was wanted there or not.

        Returns:
            After how many steps it wants to be called again; :data:`NEVER`: not any more.

        Raises:
            Ended: the run is to end here.
            ComponentFailed: a component failed to do what it was asked to.

        """


@runtime_checkable
class Lasting(Protocol):
    """What a run that is resumed has to know again of an earlier process.

    Such a hook itself remembers what it has done and has still to do.
    """

    def state(self) -> Any:
        """What there is to know, as JSON has it."""

    def restore(self, state: Any) -> None:
        """Know it again."""


class Hooks:
    """Calls hooks when their time has come."""

    def __init__(self, run: Run) -> None:
        """Call all hooks of a run first before any step, in their order."""
        self._run = run
        # By their places: two hooks may be equal, and one need not be hashable.
        self._due = [0] * len(run.hooks)

    def act(self) -> None:
        """Call those whose time has come, and let the run go on until the next one's."""
        run, due = self._run, self._due
        for i, hook in enumerate(run.hooks):
            if due[i] <= run.made:
                due[i] = hook.act(run)
        run.due = min(due, default=NEVER)


#: The clock is looked at after as many steps as take so long by it [s].
_GRAIN = 1e-3

#: How often a wait checks whether the run is to stop, or rows are due [s].
_GLANCE = 0.02

#: Latenesses are counted in classes that are so much longer one than the other, from the first on
#: [s]: a percentile is known to that share.
_RESOLUTION, _FIRST = 0.01, 1e-7

#: The share of the latenesses that is said to be below a percentile.
_SHARE = 0.99


@dataclass(frozen=True)
class InputTable:
    """Values of some inputs over time.

    Attributes:
        targets: inputs that nothing feeds.
        times: that grow [s].
        values: of each input at each time, (times, targets).
        linear: which inputs go from one value to the next in a straight line; the others hold a
            value until the next.
        exact: columns of texts and of integers of 64 bits, by their places; `values` has zeros
            there.

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
        """A table of columns, each in its type."""
        exact = {place: one for place, one in enumerate(columns) if one.dtype.kind != "f"}
        nothing = np.zeros(len(times))
        values = [nothing if place in exact else one for place, one in enumerate(columns)]
        return cls(targets, times, np.column_stack(values), np.array(linear), exact)

    @property
    def digest(self) -> str:
        """Another one for other values."""
        names = " ".join(map(str, self.targets)).encode()
        arrays = (self.times, self.values, self.linear, *self.exact.values())
        return sha256(names + b"".join(array.tobytes() for array in arrays)).hexdigest()

    def at(self, time: float, row: int) -> list[Value]:
        """The values at a time [s], of which a row is the last that is not after it."""
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
        """Whether two values that follow each other lie farther apart than any number is large."""
        with np.errstate(over="ignore"):
            return not np.isfinite(np.diff(self.values, axis=0)).all()


class Playback:
    """A hook that supplies inputs with what they have at the beginning of each step.

    Before the first time of the table they have its first values, after the last its last.
    """

    def __init__(self, input_table: InputTable) -> None:
        """Take the table that is followed."""
        self._input_table = input_table
        self._steps = np.empty(0, dtype=int)

    def act(self, run: Run) -> int:
        """Supply the values of now."""
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


class RealTime:
    """A hook that makes a run wait for a clock, and measures by how much it is late.

    A run that is late makes up for it as fast as it can: times are one clock's, from the
    first step on.

    Attributes:
        factor: simulated seconds in a second.
        lateness: of the steps whose time the clock was asked for.

    """

    @staticmethod
    def check(factor: float) -> None:
        """Check before a run that a clock can set its pace.

        Raises:
            InputError: it cannot.

        """
        if not (isfinite(factor) and factor > 0.0):
            raise InputError(f"real time x {factor:g}: the factor must be positive and finite")

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
