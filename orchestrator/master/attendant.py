"""Who acts on a run between two of its steps, and what there is to act on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from orchestrator.master.experiment import MOST_STEPS, Experiment
from orchestrator.master.instance import Instance
from orchestrator.master.observer import Blocks
from orchestrator.master.row import Row
from orchestrator.master.schedule import Stage
from orchestrator.master.signals import Signals
from orchestrator.system.structure import System

#: After more steps than any run has.
NEVER = MOST_STEPS + 1


@dataclass
class Run:
    """A run, as far as it has come.

    Attributes:
        system, experiment: what is run.
        instances: of its components, by their names.
        row: of all values.
        stages: of every step.
        signals: what is done to values on their way from outputs to inputs.
        blocks: take the rows.
        made: how many steps have been made.
        due: after how many somebody acts on it: every loop looks up there.

    """

    system: System
    experiment: Experiment
    instances: Mapping[str, Instance]
    row: Row
    stages: Sequence[Stage]
    signals: Signals
    blocks: Blocks
    made: int = 0
    due: int = NEVER

    @property
    def time(self) -> float:
        """What the components have come to [s]."""
        return self.experiment.time(self.made)


class Attendant(Protocol):
    """Somebody who acts on a run between two of its steps: an event, a checkpoint, a pace."""

    def attend(self, run: Run) -> int:
        """Act after :attr:`Run.made` steps, for the first time before any.

        Returns:
            After how many steps it wants to be called again; :data:`NEVER`: not any more.

        Raises:
            Ended: the run is to end here.
            ComponentFailed: a component did not do what it was asked for.

        """


class Attendance:
    """Calls attendants when their time has come."""

    def __init__(self, run: Run, attendants: Sequence[Attendant]) -> None:
        """Call all of them first before any step, in this order."""
        self._run = run
        self._next = dict.fromkeys(attendants, 0)

    def attend(self) -> None:
        """Call those whose time has come, and let the run go on until the next one's."""
        run = self._run
        for attendant, due in self._next.items():
            if due <= run.made:
                self._next[attendant] = attendant.attend(run)
        run.due = min(self._next.values(), default=NEVER)
