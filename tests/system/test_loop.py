"""The compiled loop does what the Python loop does, bit for bit and word for word."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.experiments.wiring import closed_loop
from orchestrator.master.experiment import ORDERS, Experiment
from orchestrator.master.simulation import simulate
from orchestrator.master.table import Table
from orchestrator.system.structure import System
from support.mixed import system_of, systems


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mixed")


def run(system: System, experiment: Experiment, loop: str) -> Table:
    table = Table()
    simulate(system, experiment, [table], None, loop)
    assert table.header.loop == loop
    return table


def same(system: System, experiment: Experiment) -> Table:
    """What both loops make of a run."""
    python, compiled = (run(system, experiment, loop) for loop in ("python", "compiled"))
    assert compiled.rows.tobytes() == python.rows.tobytes()
    assert compiled.ending == python.ending
    assert compiled.header == python.header
    return python


@settings(max_examples=60)
@given(
    arguments=systems(),
    step=st.floats(1e-3, 1.0),
    n=st.integers(1, 80),
    rest=st.sampled_from([0.0, 0.3]),
    order=st.sampled_from(ORDERS),
    rows=st.integers(2, 100),
)
def test_random_systems_give_the_same_rows_and_the_same_failures(
    folder, arguments, step, n, rest, order, rows
):
    with patch("orchestrator.master.observer._ROWS", rows):
        same(system_of(folder, **arguments), Experiment((n + rest) * step, step, order))


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("step", [0.02, 0.03])
def test_the_bundle_gives_the_same_rows(dist: Path, order: str, step: float):
    assert len(same(closed_loop(dist), Experiment(20.0, step, order))) > 600
