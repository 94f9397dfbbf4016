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


def difference(one: Outcome, other: Outcome) -> str:
    """The first difference between two outcomes, in words; empty: there is none, to the bit."""
    if (one.refusal, one.ending) != (other.refusal, other.ending):
        return f"{one.refusal or one.ending}, but {other.refusal or other.ending}"
    if one.columns != other.columns:
        return f"columns {one.columns}, but {other.columns}"
    if one.rows.shape != other.rows.shape:
        return f"{len(one.rows)} rows, but {len(other.rows)}"
    # As integers: -0.0 is not 0.0.
    places = np.argwhere(one.rows.view(np.int64) != other.rows.view(np.int64))
    if not len(places):
        return ""
    k, i = places[0]
    return (
        f"{('time', *one.columns)[i]} at t = {one.rows[k, 0]:g} s: {one.rows[k, i]!r}, but "
        f"{other.rows[k, i]!r}"
    )
