"""The choice of the loop, and the steps of the Python loop."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.cosim import loop
from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.fmi.isolated import Isolation
from orchestrator.cosim.loop import PYTHON_LOOP, choose_loop, step_interpreted
from orchestrator.cosim.row import Gathering
from orchestrator.cosim.stages import Decimation, LinkedStage, StageCall
from orchestrator.machine.errors import InputError

SHORT, LONG = Experiment(10.0, 1.0), Experiment(1e6, 1.0)


def made(limit: float, experiment: Experiment, width: int = 3) -> SimpleNamespace:
    """A run of two values: y = t + h, and x, which takes y after it; every third step shows x."""
    values = np.zeros(width)

    def act(t: float, h: float) -> None:
        values[0] = t + h if t + h < limit else np.nan

    def moved(target: int, source: int) -> Gathering:
        return Gathering(np.array([target]), np.array([source]))

    stages = [
        LinkedStage(moved(1, 0), [StageCall(act).member]),
        LinkedStage(moved(2, 1), [], Decimation(3, at_end=True)),
    ]
    rows: list[list[float]] = []
    return SimpleNamespace(
        row=SimpleNamespace(values=values, shown=values),
        blocks=SimpleNamespace(append=lambda t, shown: rows.append([t, *shown])),
        rows=rows,
        experiment=experiment,
        stages=stages,
        passing=None,
        made=0,
    )


def test_stages_come_one_after_the_other_and_slow_ones_when_they_are_due():
    run = made(99.0, Experiment(2.0, 0.5))
    assert len(list(step_interpreted(run))) == run.made == 4
    assert run.rows == [[0.5, 0.5, 0, 0], [1, 1, 0.5, 0], [1.5, 1.5, 1, 1], [2, 2, 1.5, 1.5]]


def test_a_row_shows_passed_values_and_then_components_are_stepped():
    run = made(99.0, Experiment(2.0, 0.5))
    step, show = run.stages
    run.stages, run.passing = [step], [show._replace(decimation=Decimation(2))]
    list(step_interpreted(run))
    assert run.rows == [[0, 0, 0, 0], [0.5, 0.5, 0, 0], [1, 1, 0.5, 0.5], [1.5, 1.5, 1, 0.5]]


@pytest.mark.parametrize("width", [3, 4_096, 4_097, 20_000])
def test_a_row_that_is_not_finite_is_not_kept(width: int):
    """Long rows are tested in another way."""
    run = made(1.5, Experiment(2.0, 0.5), width)
    list(step_interpreted(run))
    assert run.made == len(run.rows) == 2
    assert np.isnan(run.row.values[0])


def test_a_run_continues_after_the_steps_that_were_made():
    run = made(99.0, Experiment(2.0, 0.5))
    run.made = 2
    list(step_interpreted(run))
    assert [row[0] for row in run.rows] == [1.5, 2.0]


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> object:
    """A library that is already compiled."""
    found = object()
    monkeypatch.setattr(loop, "load_stepper", lambda: found)
    return found


def test_the_compiled_loop_is_taken_where_it_pays(library: object):
    assert choose_loop("auto", SHORT) == choose_loop("python", LONG) == PYTHON_LOOP
    assert choose_loop("auto", LONG).name == choose_loop("compiled", SHORT).name == "compiled"
    assert choose_loop("auto", LONG, Isolation()) == PYTHON_LOOP


def test_the_compiled_loop_cannot_step_isolated_fmus(library: object):
    with pytest.raises(InputError, match="isolated"):
        choose_loop("compiled", LONG, Isolation())
