"""What acts on a run between two of its steps, and what there is to act on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import c_double
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

# By name: an FMU in Python may change what the module holds.
from numpy import isfinite

from orchestrator.cosim.experiment import MOST_STEPS, Experiment
from orchestrator.cosim.fmi.instance import Instance, Log
from orchestrator.cosim.observers.observer import Blocks, Occurrence
from orchestrator.cosim.row import Overrides, Row
from orchestrator.cosim.stages import LinkedStage, make_stages
from orchestrator.cosim.system.structure import System
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
            if isfinite(self.row.shown).all():
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
