"""docs/status.md, cell by cell, for each FMU as a C program would call it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import fmpy
import pytest

from support.calls import CASES
from support.instances import NAMES
from support.status_table import CREATION, WITHOUT_AN_INSTANCE, creations, rows, without_an_instance
from support.trials import SKIPPED, Cell, trials
from support.worker import Lost, Worker

#: Longest time for a trial, on a slow machine [s].
PATIENCE = 60.0

#: By name: what the test of a cell is called.
CELLS: dict[str, Cell] = {
    **{f"{row} - {state}": (key, state) for key, row in rows().items() for state in row.cells},
    **{f"{CREATION}: {case}": ((CREATION, case), "") for case in creations()},
    **{f"on {what}": ((WITHOUT_AN_INSTANCE, what), "") for what in without_an_instance()},
}


@pytest.fixture(scope="module", params=NAMES)
def worker(
    request: pytest.FixtureRequest, dist: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Worker[Cell, str]]:
    """A process that tries cells on one of the FMUs."""
    folder = tmp_path_factory.mktemp("status")
    another = NAMES[NAMES.index(request.param) - 1]
    for name in (request.param, another):
        fmpy.extract(dist / f"{name}.fmu", unzipdir=folder / name)
    with Worker(trials, folder / request.param, folder / another) as process:
        yield process


@pytest.mark.parametrize("cell", CELLS)
def test_cell(worker: Worker[Cell, str], cell: str):
    wrong = worker.ask(CELLS[cell], PATIENCE)
    assert not isinstance(wrong, Lost), f"the process is lost: {wrong.why}"
    if wrong == SKIPPED:
        pytest.skip("this FMU has no such port")
    assert wrong == ""


def test_every_row_is_tried():
    assert CASES.keys() == rows().keys()
