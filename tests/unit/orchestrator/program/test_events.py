"""Events in programs of systems: the rows of their FMUs, and what has happened, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.cosim import (
    Alter,
    Event,
    Experiment,
    Freeze,
    Occurrence,
    Release,
    Reset,
    Set,
    Stop,
    Table,
)
from orchestrator.cosim.events import MOST_LISTED, Action, occurrence
from orchestrator.machine.compilers import machines_compiler
from orchestrator.program.components import definitions_of
from orchestrator.program.writer import Text
from orchestrator.runs.preparation import Prepared, load_scenario, prepare, with_companion
from orchestrator.runs.request import Request
from support.events import ALL, ENDS
from support.programs import compiled, play
from support.tiers import slow

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

#: Numbers of the kinds of actions, and comparisons in the order of their numbers, in events.c.
OVERRIDE, BIAS, FREEZE, RELEASE, SET, RESET, END = range(7)
COMPARISONS = ("<", "<=", ">", ">=")

#: Numbers of an event, and of an entry in the list of occurrences.
EVENT, LISTED = 13, 3

ORDERS = ("feedthrough", "gauss-seidel", "jacobi")


def runs(scenario: str, order: str | None = None, **request: Any) -> list[Prepared]:
    """Prepare a scenario and its comparison."""
    asked = Request(scenario, kind="native", order=order, **request)
    own = prepare(*load_scenario(scenario, "native"), asked)
    return with_companion(own, asked)


def check(run: Prepared, folder: Path) -> None:
    """Compare the program of a run with its FMUs."""
    table = Table()
    ending = run.run([table])
    text = Text(run.plan, definitions_of(run.plan.system), has_events=True)
    path = compiled(text.text(), folder / "program.so", "-shared")
    happened = np.zeros(1 + len(run.events) * MOST_LISTED * LISTED)
    found = play(text, path, *numbers_of(text, run.events), happened)
    assert found.outcome == (1 if ending.failure else 2 if ending.remark else 0)
    columns = [i for i, name in enumerate(table.columns) if not name.endswith(".fault")]
    assert [table.columns[i] for i in columns] == [*map(str, text.columns)]
    rows = found.rows
    assert rows[:, 0].tolist() == table.time.tolist()
    wanted = table.rows[:, [0, *(1 + i for i in columns)]]
    for i, name in enumerate(("time", *text.columns)):
        np.testing.assert_array_equal(rows[:, i], wanted[:, i], str(name))
    assert [*occurrences(run.events, happened, text.plan.experiment)] == [*ending.events]


def numbers_of(text: Text, events: Sequence[Event]) -> tuple[np.ndarray, np.ndarray]:
    """Return events and their actions as events.c has them, a row each."""
    columns = {name: i for i, name in enumerate(text.columns)}
    found, actions = np.zeros((len(events), EVENT)), list[tuple[float, ...]]()
    for row, event in zip(found, events, strict=True):
        first = len(actions)
        actions += [(*action, 0.0) for action in actions_of(text, event.action)]
        when: tuple[float, ...] = (0.0, 0.0, 0.0)
        if event.when is not None:
            comparison = COMPARISONS.index(event.when.comparison)
            when = columns[event.when.signal], comparison, event.when.value
        times = event.at is not None, event.at or 0.0, *when, event.repeat, event.lasts or 0.0
        row[: len(times) + 2] = *times, first, len(actions)
    return found, np.array(actions, dtype=float)


def actions_of(text: Text, action: Action) -> Iterator[tuple[float, float, float]]:
    """Yield the kind of each action, its input, parameter or component, and a value."""
    parameters = {name: i for i, name in enumerate(text.parameters)}
    match action:
        case Alter(effect, values):
            kind = BIAS if effect == "bias" else OVERRIDE
            yield from ((kind, text.inputs[target], float(value)) for target, value in values)
        case Freeze(targets):
            yield from ((FREEZE, text.inputs[target], 0.0) for target in targets)
        case Release(targets):
            yield from ((RELEASE, text.inputs[target], 0.0) for target in targets)
        case Set(tuned, supplied):
            for target, value in (*tuned, *supplied):
                yield SET, parameters[target], float(value)
        case Reset(components):
            yield from ((RESET, text.components.index(name), 0.0) for name in components)
        case Stop():
            yield END, 0.0, 0.0


def occurrences(
    events: Sequence[Event], happened: np.ndarray, experiment: Experiment
) -> Iterator[Occurrence]:
    """Yield what has happened, in the master's words."""
    listed = [0] * len(events)
    for number, step, ends in happened[1:].reshape(-1, LISTED)[: int(happened[0])].astype(int):
        listed[number] += 1
        time = experiment.time(step)
        yield occurrence(events[number], number, time, listed[number], ends=bool(ends))


@pytest.mark.parametrize("order", [ORDERS[0], *slow(*ORDERS[1:])])
@pytest.mark.parametrize("last", ENDS)
def test_events_of_all_kinds_do_what_they_do_to_fmus(last, order, tmp_path):
    scenario = tmp_path / "mine.toml"
    scenario.write_text(ALL.replace("LAST", ENDS[last]))
    check(runs(str(scenario), order)[0], tmp_path)


@pytest.mark.parametrize(
    "name", ["fault-sensor", "fault-thruster", *slow("current-step", "formation-lost-link")]
)
def test_events_of_scenarios_do_what_they_do_to_fmus(name, tmp_path):
    for run in runs(name):
        # A library that is loaded is not loaded again from the same place.
        folder = tmp_path / run.scenario.name
        folder.mkdir()
        check(run, folder)
