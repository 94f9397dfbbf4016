"""FMUs of FMI 3.0 run as those of FMI 2.0 do, alone, among themselves, and with these."""

from __future__ import annotations

import json
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import Experiment
from orchestrator.system.names import port_name
from orchestrator.system.structure import System
from support import others, typed
from support.others import WAYS
from support.runs import run_table
from support.texts import mentions

EVERY_WAY = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)

H, STOP = 0.125, 2.0
STEPS = 16


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return typed.build(tmp_path_factory.mktemp("typed"))


def run(system: System, order: str = "gauss-seidel", stop_time: float = STOP, **how):
    return run_table(system, Experiment(stop_time, H, order), **how)


def test_the_fmu_is_valid(fmu):
    assert validate_fmu(str(fmu)) == []


@EVERY_WAY
def test_every_type_passes_through_three_fmus_exactly(fmu, way):
    wires = {
        f"{to}.u_{of}": f"{start}.y_{of}" for start, to in ("ab", "bc") for of in typed.SCALARS
    }
    values = {f"a.u_{of}": value for of, value in typed.VALUES.items()}
    table = run(system := typed.system_of(fmu, "abc", wires, values), **way)
    assert table.failure is None and len(table) == STEPS + 1
    for of, value in typed.VALUES.items():
        for name in "abc":
            assert set(table[f"{name}.y_{of}"].tolist()) == {value}, of
    assert table.columns == run(system).columns
    assert table.rows.tobytes() == run(system).rows.tobytes()


def slave_of(fmu: Path, folder: Path) -> FMU3Slave:
    slave = FMU3Slave(
        guid="typed", unzipDirectory=fmpy.extract(str(fmu), folder), modelIdentifier="typed",
        instanceName="a",
    )  # fmt: skip
    slave.instantiate()
    return slave


@EVERY_WAY
def test_arrays_are_the_ones_that_fmpy_gets(fmu, tmp_path, way):
    values = {"a.M[1,3]": 0.25, "a.M[2,1]": -7.5, "a.v[2]": 1e-3, "a.gain[2]": 3.0}
    values |= {"a.u_Float64": 2.0, "a.names[2]": "x y", "a.u_String": "!"}
    table = run(typed.system_of(fmu, parameters=values), **way)
    slave = slave_of(fmu, tmp_path / "unpacked")
    slave.setFloat64([typed.M], [1.0, 2.0, 0.25, -7.5, 5.0, 6.0])
    slave.setFloat64([typed.GAIN], [1.0, 3.0])
    slave.setString([typed.NAMES], ["a", "x y"])
    slave.enterInitializationMode(startTime=0.0)
    first = typed.N + 6
    slave.setFloat64([typed.V], [0.0, 1e-3, 0.5])
    slave.setFloat64([first], [2.0])
    slave.setString([first + 24], ["!"])
    slave.exitInitializationMode()
    for k in range(STEPS + 1):
        if k:
            slave.doStep((k - 1) * H, H)
        expected = slave.getFloat64([typed.X, typed.W], 3)
        found = [table[f"a.{name}"][k] for name in ("x", "w[1]", "w[2]")]
        assert found == expected
        assert [table[f"a.steps[{i}]"][k] for i in (1, 2, 3)] == slave.getInt16([typed.STEPS], 3)
        assert [table[f"a.joined[{i}]"][k] for i in (1, 2)] == slave.getString([typed.JOINED], 2)
    slave.freeInstance()
    # w = gain (M v) + x, by hand: x = 2 t.
    assert table["a.w[2]"][-1] == 3.0 * (5e-3 + 3.0) + 2.0 * STOP
    held = {str(name): value for name, value in table.parameters.items()}
    assert [held[f"a.M[{i},{j}]"] for i in (1, 2) for j in (1, 2, 3)] == [1, 2, 0.25, -7.5, 5, 6]
