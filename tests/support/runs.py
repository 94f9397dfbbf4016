"""Runs in memory: of a system or a scenario, and what tests ask of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cosim import (
    Experiment,
    Hook,
    Isolation,
    Order,
    System,
    Table,
    make_plan,
    simulate_plan,
)
from orchestrator.cosim.observers import CsvFile
from orchestrator.runs.preparation import (
    Prepared,
    load_scenario,
    prepare,
    prepare_request,
    with_companion,
)
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.vehicle.indices import metrics_of

#: The second run of a scenario with the paper's controller, as its file has it.
PD = """
[compare]
name = "pd"
label = "PD"
components.controller = "PdController"
wires."controller.dy" = "plant.dy"
"""


def companion(scenario: str) -> Prepared:
    """The run that a scenario is compared with, of native FMUs."""
    request = Request(scenario, kind="native")
    return with_companion(prepare_request(request), request)[1]


def compared(scenario: str, **changes: Any) -> list[Table]:
    """All rows of a scenario and of the run that it is compared with."""
    request, tables = Request(scenario, kind="native", loop="compiled", **changes), []
    for run in with_companion(prepare_request(request), request):
        tables.append(Table())
        run.run([tables[-1]])
    return tables


class InThisProcess:
    """Tasks one after the other, and counted, instead of workers in processes."""

    def __init__(self) -> None:
        self.done: list[Any] = []

    def results(
        self, tasks: Mapping[Any, Callable[[], Any]], unit: str
    ) -> Iterator[tuple[Any, Any]]:
        for key, task in tasks.items():
            self.done.append(key)
            yield key, task()


def run_table(
    system: System,
    experiment: Experiment,
    loop: str = "python",
    isolation: Isolation | None = None,
    hooks: Sequence[Hook] = (),
) -> Table:
    """All rows of a run, however it ends."""
    table = Table()
    simulate_plan(make_plan(system, experiment, isolation, loop), [table], hooks)
    return table


def whole(system: System, experiment: Experiment, *args: Any, **how: Any) -> Table:
    """All rows of a run that comes to its end."""
    table = run_table(system, experiment, *args, **how)
    assert table.failure is None
    return table


def run(
    system: System,
    stop_time: float,
    step: float,
    order: Order = "feedthrough",
    loop: str = "python",
) -> Table:
    """All rows of a run, by its times."""
    return run_table(system, Experiment(stop_time, step, order), loop)


def system_of(fmus: Path, scenario: str) -> System:
    """The closed loop of a scenario, of the FMUs in a folder."""
    return closed_loop(fmus, read_scenario(scenario))


def prepared(name: str | Path, kind: str = "native", request: Request | None = None) -> Prepared:
    """A scenario, ready to be run."""
    return prepare(*load_scenario(str(name), kind), request or Request(kind=kind))


def write(table: Table, path: Path) -> None:
    """The table as the command line writes it."""
    file = CsvFile(path)
    file.begin(table.header)
    file.take(table.rows)
    file.end(table.ending)


def final_error(table: Table) -> np.ndarray:
    """e_f of section 4.2 [m]."""
    return np.array(metrics_of(table).found()["final_error"])
