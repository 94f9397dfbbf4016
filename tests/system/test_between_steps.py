"""Who acts between two steps acts there in both loops, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kinds import NATIVE
from orchestrator.master.experiment import ORDERS, Experiment
from orchestrator.master.fmi.instance import Ended
from orchestrator.master.hooks.hook import NEVER, Run
from orchestrator.master.loop import chosen
from orchestrator.master.observers.table import Table
from orchestrator.master.plan import planned
from orchestrator.master.simulation import simulate
from orchestrator.runs.loading import load
from orchestrator.system.names import port_name
from support.machine import LOOPS

#: Until when [s], and in which steps.
EXPERIMENT = Experiment(14.0, 0.02)


class Pushes:
    """Surge force of zero from one time to another, and the end of the run at a third [steps]."""

    def __init__(self, begin: int, end: int, stop: int = NEVER) -> None:
        self._acts = {begin: self._begin, end: self._end, stop: self._stop}
        self.times: list[int] = []

    def act(self, run: Run) -> int:
        self.times.append(run.made)
        if act := self._acts.pop(run.made, None):
            act(run)
        return min(self._acts, default=NEVER)

    def _begin(self, run: Run) -> None:
        run.overrides.override(port_name("plant.tau.u"), 0.0)

    def _end(self, run: Run) -> None:
        run.overrides.release(port_name("plant.tau.u"))

    def _stop(self, run: Run) -> None:
        raise Ended("enough")


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("order", ORDERS)
def test_a_hook_acts_on_the_steps_that_it_names(loop, order):
    system, experiment = load("fig4", NATIVE), Experiment(14.0, 0.02, order)
    table, pushes = Table(), Pushes(10, 620, 650)
    ending = simulate(
        planned(system, experiment), [table], None, chosen(loop, experiment), hooks=[pushes]
    )
    assert pushes.times == [0, 10, 620, 650]
    assert (ending.failure, ending.remark) == (None, "ended at t = 13 s: enough")
    assert len(table) == 651
    # A row holds the inputs that the step before it was made with.
    force, command = table["plant.tau.u"], table["controller.tau.u"]
    free = np.r_[1:11, 621:651]
    np.testing.assert_array_equal(force[11:621], 0.0)
    np.testing.assert_array_equal(force[free], command[free - (order == "jacobi")])
