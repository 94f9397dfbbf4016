"""Runs of small FMUs with known motion, from the first row to the end."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.hooks import Run
from orchestrator.cosim.observers import Ending, Header, Table
from orchestrator.cosim.plan import make_plan
from orchestrator.cosim.simulation import simulate_plan
from orchestrator.cosim.system import System
from orchestrator.machine.errors import InputError
from support.linear import SINE, Part, linear, system_of
from support.texts import mentions

EXPERIMENT = Experiment(1.0, 0.125)


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    """A sine, and a component that doubles it with direct feedthrough."""
    fmu = linear(tmp_path_factory.mktemp("linear"))
    parts = {"double": Part(D=[[0, 0], [2, 0]]), "sine": SINE}
    return system_of(dict.fromkeys(parts, fmu), parts, {"double.u0": "sine.y0"})


class Watching:
    """An observer that records its calls, and may fail at the beginning."""

    def __init__(self, calls: list[object], fails: bool = False) -> None:
        self.calls, self.fails = calls, fails

    def begin(self, header: Header) -> None:
        self.calls.append(header)
        if self.fails:
            raise ValueError("no room")

    def take(self, rows: np.ndarray) -> None:
        self.calls.append(rows.copy())

    def end(self, ending: Ending) -> None:
        self.calls.append(ending)


def test_rows_show_the_solution_from_the_start_to_the_end(system: System):
    table = Table()
    ending = simulate_plan(make_plan(system, EXPERIMENT), [table])
    assert (ending.failure, ending.messages, len(table)) == (None, (), 9)
    np.testing.assert_array_equal(table.time, 0.125 * np.arange(9))
    np.testing.assert_allclose(table["sine.y0"], np.sin(table.time), atol=1e-12)
    # An output of a state shows the state of the same time.
    np.testing.assert_allclose(table["double.y1"], 2.0 * np.sin(table.time), atol=1e-12)


def test_observers_are_told_header_rows_and_end(system: System):
    calls: list[object] = []
    ending = simulate_plan(make_plan(system, EXPERIMENT), [Watching(calls)])
    header, *blocks, last = calls
    assert header.parameters[PortName.read("sine.x1")] == 1.0
    assert header.experiment == replace(EXPERIMENT, order="feedthrough")
    assert np.vstack(blocks).shape == (9, 1 + len(header.columns))
    assert last == ending


def test_an_observer_that_fails_keeps_no_other_from_its_end(system: System):
    calls: list[object] = []
    with pytest.raises(ValueError, match="no room"):
        simulate_plan(make_plan(system, EXPERIMENT), [Watching(calls), Watching([], fails=True)])
    header, ending = calls
    assert isinstance(header, Header) and mentions(ending.failure, "no room")


def test_a_value_that_is_not_finite_ends_the_run_before_its_row(system: System):
    table = Table()
    grows = system.with_parameters(
        {PortName.read("sine.A00"): 1e308, PortName.read("sine.x0"): 1.0}
    )
    ending = simulate_plan(make_plan(grows, EXPERIMENT), [table])
    assert mentions(ending.failure, "0.125 sine.y0")
    assert len(table) == 1
    with pytest.raises(InputError, match="sine"):
        ending.require_success("sine")


@pytest.mark.parametrize("frozen", [False, True], ids=["not hashable", "equal"])
def test_every_hook_is_called_whatever_it_is(system: System, frozen: bool):
    @dataclass(frozen=frozen)
    class Every:
        steps: int

        def act(self, run: Run) -> int:
            called.append((run.made, self.steps))
            return run.made + self.steps

    called: list[tuple[int, int]] = []
    simulate_plan(make_plan(system, EXPERIMENT), hooks=[Every(3), Every(4), Every(3)])
    assert called == [(0, 3), (0, 4), (0, 3), (3, 3), (3, 3), (4, 4), (6, 3), (6, 3), (8, 4)]
