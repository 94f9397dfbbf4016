"""The reference results in the repository, and the check that users make with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy.util import read_csv, read_ref_opt_file

from fmus.packaging.discovery import components
from orchestrator.errors import InputError
from orchestrator.exchange.reference import reference_outputs
from orchestrator.exchange.verify import verify
from orchestrator.experiments.wiring import closed_loop
from orchestrator.system.component import read_component
from orchestrator.system.structure import System
from support.runs import run, write

COMMITTED = Path(__file__).parents[2] / "reference"
NAMES = list(components())


@pytest.fixture(scope="module")
def system(dist: Path) -> System:
    return closed_loop(dist)


@pytest.mark.parametrize("name", NAMES)
def test_a_fresh_run_of_each_fmu_is_the_reference(dist: Path, name: str):
    """To 1e-9: the libraries of mathematics of two machines may differ in the last place."""
    component = read_component(name, dist / f"{name}.fmu")
    path = COMMITTED / f"{name}_in.csv"
    inputs = read_csv(path) if path.is_file() else None
    outputs = reference_outputs(component, inputs)
    expected = read_csv(COMMITTED / f"{name}_ref.csv")
    assert outputs.dtype.names == expected.dtype.names
    for port in expected.dtype.names:
        np.testing.assert_allclose(outputs[port], expected[port], rtol=1e-9, atol=1e-9)
    assert read_ref_opt_file(COMMITTED / f"{name}_ref.opt")["StopTime"] == expected["time"][-1]


def test_a_fresh_run_of_the_system_is_the_reference(system: System):
    assert "agree over 4 s, in jacobi order" in verify(COMMITTED / "auv_ref.csv", system, 1e-9)


def test_own_table_is_verified_in_its_order(system: System, tmp_path: Path):
    path = tmp_path / "ours.csv"
    write(run(system, 2.0, 0.02), path)
    assert "in gauss-seidel order" in verify(path, system, 1e-12)


def test_table_of_another_tool_is_understood(system: System, tmp_path: Path):
    """Other separators, a prefix, quotes, Booleans as words, every fifth row, fewer columns."""
    result = run(system, 2.0, 0.02, "jacobi")
    path = tmp_path / "theirs.csv"
    rows = zip(result.time[::5], result["plant.eta.x"][::5], strict=True)
    lines = ['"Time", "auv.plant::eta.x[REAL]","controller.fault","controller.saturation"']
    lines += [f"{t!r}, {x!r},False,tanh" for t, x in ((float(t), float(x)) for t, x in rows)]
    path.write_text("\n".join(lines))
    assert "2 ports agree over 2 s, in jacobi order" in verify(path, system, 1e-9)


def test_first_port_that_differs_is_named(system: System, tmp_path: Path):
    result = run(system, 2.0, 0.02, "jacobi")
    result.rows[60:, result.columns.index("planner.y_d.z") + 1] += 1e-3
    result.rows[80:, result.columns.index("plant.eta.x") + 1] += 1.0
    write(result, tmp_path / "wrong.csv")
    with pytest.raises(InputError, match=r"planner\.y_d\.z differs first, at t = 1\.2 s"):
        verify(tmp_path / "wrong.csv", system, 1e-6)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not a readable table"),
        ("time,plant.eta.x\n0,1\n1,nan\n", "differs first"),
        ("time,depth\n0,1\n1,2\n", "no column is named after an output"),
        ("clock,plant.eta.x\n0,1\n1,2\n", "no column of numbers is named time"),
        ("time,plant.eta.x\n0,1\n0,2\n", "does not advance"),
        ("time,plant.eta.x\nzero,1\none,2\n", "no column of numbers is named time"),
    ],
)
def test_table_that_cannot_be_used_is_refused(system, tmp_path, text, reason):
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=reason):
        verify(path, system, 1e-6)
