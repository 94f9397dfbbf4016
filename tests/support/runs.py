"""Runs in memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orchestrator.master.experiment import Experiment, Order
from orchestrator.master.loop import chosen
from orchestrator.master.observers.files import CsvFile
from orchestrator.master.observers.table import Table
from orchestrator.master.simulation import simulate
from orchestrator.runs.preparation import Prepared, Request, loaded, prepare
from orchestrator.system.structure import System
from orchestrator.vehicle.indices import metrics_of


def run(
    system: System,
    stop_time: float,
    step: float,
    order: Order = "gauss-seidel",
    loop: str = "python",
) -> Table:
    """All rows of a run."""
    table, experiment = Table(), Experiment(stop_time, step, order)
    simulate(system, experiment, [table], loop=chosen(loop, experiment))
    return table


def prepared(name: str | Path, kind: str = "native", request: Request | None = None) -> Prepared:
    """A scenario, ready to be run."""
    return prepare(*loaded(str(name), kind), request or Request(kind=kind))


def write(table: Table, path: Path) -> None:
    """The table as the command line writes it."""
    file = CsvFile(path)
    file.begin(table.header)
    file.take(table.rows)
    file.end(table.ending)


def final_error(table: Table) -> np.ndarray:
    """e_f of section 4.2 [m]."""
    return np.array(metrics_of(table).found()["final_error"])
