"""FMUs of FMI 3.0: single, several, and together with FMUs of FMI 2.0."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from orchestrator.commands.main import main
from orchestrator.cosim import (
    Events,
    Experiment,
    Linear,
    PortName,
    System,
    Table,
    make_plan,
    simulate_plan,
)
from orchestrator.cosim.observers import CsvFile, ParquetFile
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_events
from support import others, typed
from support.others import WAYS
from support.runs import run_table
from support.runs import system_of as closed_loop_of
from support.settings import NAMES
from support.small_fmus import connected
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
        f"{to}.u_{kind}": f"{start}.y_{kind}"
        for start, to in ("ab", "bc")
        for kind in typed.SCALARS
    }
    values = {f"a.u_{kind}": value for kind, value in typed.VALUES.items()}
    table = run(system := typed.system_of(fmu, "abc", wires, values), **way)
    assert table.failure is None and len(table) == STEPS + 1
    for kind, value in typed.VALUES.items():
        for name in "abc":
            assert set(table[f"{name}.y_{kind}"].tolist()) == {value}, kind
    assert table.columns == run(system).columns
    assert table.rows.tobytes() == run(system).rows.tobytes()


@EVERY_WAY
def test_arrays_are_the_ones_that_fmpy_gets(fmu, tmp_path, way):
    values = {"a.M[1,3]": 0.25, "a.M[2,1]": -7.5, "a.v[2]": 1e-3, "a.gain[2]": 3.0}
    values |= {"a.u_Float64": 2.0, "a.names[2]": "x y", "a.u_String": "!"}
    table = run(typed.system_of(fmu, parameters=values), **way)
    slave = FMU3Slave(
        guid="typed", unzipDirectory=fmpy.extract(str(fmu), tmp_path), modelIdentifier="typed",
        instanceName="a",
    )  # fmt: skip
    slave.instantiate()
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


def test_functions_that_no_run_calls_may_be_missing(tmp_path):
    table = run(typed.system_of(typed.build(tmp_path, "-DLACKS"), parameters={"a.complains": True}))
    assert len(table) == STEPS + 1
    # Percent signs are the message's own: in FMI 3.0 it is complete.
    assert "a: 100 % of it" in table.ending.messages


def test_integers_beyond_doubles_come_to_files_exactly(fmu, tmp_path):
    begin = 2**53 + 1
    system = typed.system_of(fmu, parameters={"a.counts_from": begin, "a.u_UInt64": 2**64 - 1})
    expected = [begin + k for k in range(STEPS + 1)]
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra `parquet`")
    table = Table()
    files = [CsvFile(tmp_path / "it.csv"), ParquetFile(tmp_path / "it.parquet")]
    plan = make_plan(system, Experiment(STOP, H))
    simulate_plan(plan, [table, *files])
    assert table["a.counter"].tolist() == expected
    assert table.header.parameters[PortName.read("a.counts_from")] == begin
    lines = (tmp_path / "it.csv").read_text().splitlines()
    places = [lines[0].split(",").index(name) for name in ("a.counter", "a.y_UInt64")]
    found = [[int(line.split(",")[place]) for place in places] for line in lines[1:]]
    assert found == [[value, 2**64 - 1] for value in expected]
    read = parquet.read_table(tmp_path / "it.parquet")
    assert read["a.counter"].to_pylist() == expected


@EVERY_WAY
def test_it_ends_the_run_with_the_last_step_that_was_made_before(fmu, way):
    values = {"a.end_at": 0.8, "a.u_Float64": 1.0, "b.u_Float64": 1.0}
    system = typed.system_of(fmu, "ab", {"b.u_Int32": "a.y_Int32"}, values)
    table = run(system, **way)
    assert table.failure is None
    assert mentions(table.ending.remark, "a 0.8 s")
    assert table.time.tolist() == [0.125 * k for k in range(7)]
    # x' = 1, from zero.
    assert table["a.x"] == pytest.approx(table.time, abs=1e-12)
    assert table["b.x"] == pytest.approx(table.time, abs=1e-12)


@EVERY_WAY
@pytest.mark.parametrize(
    ("values", "words"),
    [({"a.early_at": 0.8}, "a early 0.8 s"), ({"a.u_Float64": -1.0}, "a: doStep 2 discard")],
)
def test_a_step_that_it_does_not_make_is_a_failure(fmu, way, values, words):
    table = run(typed.system_of(fmu, parameters=values), **way)
    assert mentions(table.failure, words)


@EVERY_WAY
@pytest.mark.parametrize("old", [(), ("AuvPlant", "MotionPlanner")])
def test_our_loop_has_the_same_rows_in_both_versions(native, dist3, tmp_path, way, old):
    for name in NAMES:
        shutil.copy((native if name in old else dist3) / f"{name}.fmu", tmp_path)
    ours, theirs = (
        run_table(closed_loop_of(folder, "fig4"), Experiment(1.0, 0.02), **how)
        for folder, how in ((native, {}), (tmp_path, way))
    )
    assert theirs.failure is None and len(theirs) == 51
    assert theirs.columns == ours.columns and theirs.header.parameters == ours.header.parameters
    assert theirs.rows.tobytes() == ours.rows.tobytes()


#: Wires between the versions; each input is fed once.
FEEDING = {
    "new.u_Float64": "old.y",
    "new.u_Int64": "old.mode_y",
    "new.u_Boolean": "old.fault",
    "new.u_String": "old.heard",
    "old.u": "new.y_UInt32",
    "old.mode": "new.y_Int8",
    "old.on": "new.y_Boolean",
    "old.said": "new.y_String",
}


@EVERY_WAY
@pytest.mark.parametrize("fed", ["new", "old"])
def test_versions_feed_each_other(fmu, tmp_path, way, fed):
    values = {"old.u": 0.3, "old.mode": 4, "old.on": True, "old.said": "ö"}
    values |= {"new.u_UInt32": 2**32 - 1, "new.u_Int8": 4, "new.u_Boolean": True}
    values |= {"new.u_String": "ä"}
    wires = {to: source for to, source in FEEDING.items() if to.startswith(fed)}
    fmus = {"new": fmu, "old": others.build(tmp_path)}
    given = {name: value for name, value in values.items() if name not in wires}
    table = run(connected("both", fmus, wires, given), **way)
    assert table.failure is None
    inputs = {"old.y": "old.u", "old.mode_y": "old.mode", "old.fault": "old.on"}
    inputs |= {"old.heard": "old.said"}
    for target, source in wires.items():
        assert table[target].tolist() == table[source].tolist()
        expected = values[inputs.get(source, source.replace("y_", "u_"))]
        assert set(table[target].tolist()) == {expected}, target


@pytest.mark.parametrize(
    ("source", "target"),
    [
        ("old.y", "new.u_Float32"),
        ("new.y_Int64", "old.u"),
        ("new.y_Int32", "new.u_Float32"),
        ("new.y_Int8", "new.u_UInt8"),
        ("new.y_Int64", "old.mode"),
        ("new.y_Boolean", "new.u_Int8"),
        ("new.y_String", "old.on"),
    ],
)
def test_a_wire_that_could_lose_a_value_is_refused_with_both_types(fmu, tmp_path, source, target):
    fmus = {"new": fmu, "old": others.build(tmp_path)}
    system = connected("both", fmus, {target: source})
    types = [
        system.component(n).variable(p).type for n, p in (source.split("."), target.split("."))
    ]
    with pytest.raises(InputError) as error:
        run(system)
    assert mentions(str(error.value), " ".join([source, target, *types]))


def test_ignored_variables_are_reported_and_refused_on_request(fmu, tmp_path, capsys):
    table = run(typed.system_of(fmu))
    assert mentions(table.ending.messages[0], "a bytes, clock")
    for name, words in (
        ("bytes", "a.bytes Binary"), ("clock", "a.clock Clock"), ("n", "a.n structuralParameter"),
        ("v", "a.v list 3 a.v[1]"), ("v[4]", "a v[4]"),
    ):  # fmt: skip
        with pytest.raises(InputError) as error:
            run(typed.system_of(fmu, parameters={f"a.{name}": 1}))
        assert mentions(str(error.value), words)
    with pytest.raises(InputError, match=r"a\.bytes .*Binary"):
        run(typed.system_of(fmu, "ab", {"a.bytes": "b.y_Int8"}))
    assert main(["run", str(fmu), "--stop-time", "1", "--columns", "typed.bytes"]) == 2
    assert mentions(capsys.readouterr().err, "typed.bytes Binary")
    scheduled = ("CoSimulation", "ScheduledExecution")
    with pytest.raises(InputError, match="scheduled execution"):
        typed.system_of(typed.build(tmp_path, change=scheduled))


@EVERY_WAY
def test_events_set_one_element_and_keep_the_others(fmu, way):
    tables = [
        {"at": 0.5, "set": {"a.gain[2]": 10.0}},
        {"at": 1.0, "override": {"a.u_Int64": 2**62 + 1}, "for": 0.5},
        {"at": 1.75, "reset": ["a"]},
        {"when": f"a.counter >= {2**53 + 12}", "set": {"a.v[3]": 0.0}},
    ]
    values = {"a.counts_from": 2**53, "a.gain[1]": 4.0, "b.u_Float64": 1.0}
    system = typed.system_of(fmu, "ab", parameters=values)
    events = read_events("here", tables, system)
    table = run(system, hooks=[Events(events)], **way)
    # w = gain (M v), v = (0, 0, 0.5), until v is zero.
    assert table["a.w[1]"].tolist() == [6.0] * 13 + [0.0] * 4
    assert table["a.w[2]"].tolist() == [3.0] * 5 + [30.0] * 8 + [0.0] * 4
    assert table["a.counter"].tolist() == [2**53 + k for k in (*range(15), 1, 2)]
    large = [k in range(9, 13) for k in range(17)]
    assert table["a.y_Int64"].tolist() == [(2**62 + 1) * is_large for is_large in large]


@pytest.mark.parametrize("kind", ["Float64", "Float32"])
def test_a_ring_of_one_type_is_solved_by_its_derivatives_or_without(fmu, tmp_path, kind):
    plain = typed.build(tmp_path, change=('providesDirectionalDerivatives="true"', ""))
    for path in (fmu, plain):
        wires = {f"a.u_{kind}": f"b.y_{kind}", f"b.u_{kind}": f"a.y_{kind}"}
        system = typed.system_of(path, "ab", wires)
        wired = [
            replace(wire, transformation=Linear(-2.0, offset))
            for wire, offset in zip(system.connections, (3.0, 4.0), strict=True)
        ]
        table = run(replace(system, connections=tuple(wired)))
        assert table.failure is None
        # a = 3 - 2 b, b = 4 - 2 a: values that go round would grow.
        assert table[f"a.y_{kind}"] == pytest.approx(5 / 3, rel=1e-6)
        assert table[f"b.y_{kind}"] == pytest.approx(2 / 3, rel=1e-6)
