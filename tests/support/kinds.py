"""The same run on both kinds of FMUs, and the first difference between the two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmus.kinds import NATIVE, PYTHON
from orchestrator.cosim import Ending, Experiment, PortName, Table, make_plan, simulate_plan
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop

#: The fixtures with the FMUs of each kind.
FIXTURES = {PYTHON: "dist", NATIVE: "native"}


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run: a refusal before its first step, or an ending and rows."""

    refusal: str
    ending: Ending | None
    columns: tuple[str, ...]
    rows: np.ndarray

    @property
    def failure(self) -> str | None:
        return self.ending.failure if self.ending else self.refusal


def outcome(
    fmus: Path, scenario: str, values: Mapping[str, object], experiment: Experiment
) -> Outcome:
    """Run a scenario on the FMUs of a folder.

    Args:
        fmus: the folder.
        scenario: its name.
        values: of parameters, by `component.parameter`.
        experiment: how long, in which steps.

    """
    changes = {PortName.read(name): value for name, value in values.items()}
    table = Table()
    try:
        system = closed_loop(fmus, read_scenario(scenario)).with_parameters(changes)
        ending = simulate_plan(make_plan(system, experiment), [table])
    except InputError as error:
        return Outcome(str(error), None, (), np.empty((0, 0)))
    columns = table.header.columns
    return Outcome("", ending, columns, np.column_stack((table.time, table.group(*columns))))


def difference(first: Outcome, second: Outcome) -> str:
    """The first difference between two outcomes, in words; empty: there is none, to the bit."""
    if (first.refusal, first.ending) != (second.refusal, second.ending):
        return f"{first.refusal or first.ending}, but {second.refusal or second.ending}"
    if first.columns != second.columns:
        return f"columns {first.columns}, but {second.columns}"
    if first.rows.shape != second.rows.shape:
        return f"{len(first.rows)} rows, but {len(second.rows)}"
    # As integers: -0.0 is not 0.0.
    places = np.argwhere(first.rows.view(np.int64) != second.rows.view(np.int64))
    if not len(places):
        return ""
    k, i = places[0]
    return (
        f"{('time', *first.columns)[i]} at t = {first.rows[k, 0]:g} s: {first.rows[k, i]!r}, but "
        f"{second.rows[k, i]!r}"
    )
