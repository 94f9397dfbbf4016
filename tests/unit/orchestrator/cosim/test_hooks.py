"""A clock limits the speed of a run, whose lateness is measured."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim import hooks as timing
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.hooks import NEVER, Lateness, RealTime


class World:
    """A clock that moves when a process sleeps, or computes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.handed_over = 1000.0, 0
        monkeypatch.setattr(timing, "monotonic", lambda: self.now)
        monkeypatch.setattr(timing, "sleep", self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.now += seconds

    def hand_over(self) -> None:
        self.handed_over += 1
        self.blocks.due = self.now + 0.2

    def run(self, experiment: Experiment, made: int = 0) -> SimpleNamespace:
        self.blocks = SimpleNamespace(due=self.now + 0.2, hand_over=self.hand_over)
        return SimpleNamespace(experiment=experiment, made=made, blocks=self.blocks, interrupts=[])

    def advance(self, clock: RealTime, run: SimpleNamespace, costs: list[float]) -> list[float]:
        """Make steps of given durations, and return the times after the calls of the clock [s]."""
        let_go = []
        begun, due = self.now, 0
        for cost in [*costs, 0.0]:
            run.time = run.experiment.time(run.made)
            if run.made >= due:
                due = clock.act(run)
                let_go.append(self.now - begun)
            self.now += cost
            run.made += 1
        return let_go


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_steps_end_when_the_clock_says_so(monkeypatch, factor):
    world, clock = World(monkeypatch), RealTime(factor)
    run = world.run(Experiment(1.0, 0.25))
    let_go = world.advance(clock, run, [0.01, 0.0, 0.02, 0.01])
    np.testing.assert_allclose(let_go, np.arange(5) * 0.25 / factor, atol=1e-9)
    assert clock.lateness.worst < 1e-9
    # Rows are handed over during a wait.
    assert world.handed_over >= int(1.0 / factor / 0.25) - 1


def test_a_step_that_is_late_is_made_up_for(monkeypatch):
    """0.7 s for a step of 0.25 s: the third is still late, the fourth is not."""
    world, clock = World(monkeypatch), RealTime(1.0)
    let_go = world.advance(clock, world.run(Experiment(1.0, 0.25)), [0.0, 0.7, 0.0, 0.0])
    np.testing.assert_allclose(let_go, [0.0, 0.25, 0.95, 0.95, 1.0], atol=1e-9)
    assert clock.lateness.worst == pytest.approx(0.45)
    assert clock.lateness.mean == pytest.approx((0.45 + 0.2) / 4)


def test_a_resumed_run_begins_at_its_time(monkeypatch):
    world, clock = World(monkeypatch), RealTime(1.0)
    let_go = world.advance(clock, world.run(Experiment(10.0, 0.25), made=20), [0.0, 0.0])
    np.testing.assert_allclose(let_go, [0.0, 0.25, 0.5], atol=1e-9)


def test_steps_shorter_than_a_millisecond_are_taken_together(monkeypatch):
    world, clock = World(monkeypatch), RealTime(10.0)
    run = world.run(Experiment(0.05, 1e-3))
    assert len(world.advance(clock, run, [0.0] * 50)) == 1 + 5
    run.made = 45
    run.time = run.experiment.time(45)
    assert clock.act(run) == 50
    run.made = 50
    assert clock.act(run) == NEVER


def test_who_stops_a_run_does_not_wait(monkeypatch):
    world, clock = World(monkeypatch), RealTime(1e-3)
    run = world.run(Experiment(1.0, 0.5))
    run.time = 0.0
    clock.act(run)
    run.made, run.time, run.interrupts = 1, 0.5, [2]
    before = world.now
    clock.act(run)
    assert world.now == before


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=300))
def test_lateness_equals_the_statistics_of_a_list(seconds):
    late = Lateness()
    for second in seconds:
        late.take(second)
    assert late.worst == max(seconds)
    assert late.mean == pytest.approx(np.mean(seconds))
    exact = float(np.percentile(seconds, 99, method="inverted_cdf"))
    assert exact - 1e-7 <= late.percentile * (1.0 + 1e-9)
    assert late.percentile <= 1.011 * exact + 1.1e-7
