"""The reference results in the repository, and the check that users make with them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.util import read_csv, read_ref_opt_file, write_csv

from fmus.discovery import REFERENCE, components, source_of
from orchestrator.commands.main import main
from orchestrator.cosim import (
    Experiment,
    Order,
    PortName,
    System,
    read_component,
)
from orchestrator.exchange.verify import verify
from orchestrator.machine.errors import InputError
from orchestrator.runs.wiring import closed_loop
from reference import reference_outputs
from support.runs import run, write
from support.texts import mentions, numbers_in, tells

COMMITTED = Path(__file__).parents[2] / REFERENCE

#: Orders in which tools step the components.
ORDER = ("plant", "controller", "disturbance", "planner")
OTHER_ORDER = ("controller", "plant", "planner", "disturbance")


@pytest.mark.parametrize("name", components())
def test_a_fresh_run_of_each_fmu_is_the_reference(dist: Path, name: str):
    """To 1e-9: the libraries of mathematics of two machines may differ in the last place."""
    component = read_component(name, dist / f"{name}.fmu")
    committed = source_of(name).folder / REFERENCE
    path = committed / f"{name}_in.csv"
    inputs = read_csv(path) if path.is_file() else None
    outputs = reference_outputs(component, inputs)
    expected = read_csv(committed / f"{name}_ref.csv")
    assert outputs.dtype.names == expected.dtype.names
    for port in expected.dtype.names:
        np.testing.assert_allclose(outputs[port], expected[port], rtol=1e-9, atol=1e-9)
    assert read_ref_opt_file(committed / f"{name}_ref.opt")["StopTime"] == expected["time"][-1]


def test_a_fresh_run_of_the_system_is_the_reference(system: System):
    assert "to 4 s, in jacobi order" in verify(COMMITTED / "auv_ref.csv", system, 1e-9)


@pytest.mark.parametrize("order", Experiment.ORDERS)
def test_own_table_is_verified_in_its_order(system: System, tmp_path: Path, order: Order):
    path = tmp_path / "ours.csv"
    write(run(system, 1.0, 0.02, order), path)
    assert f" s, in {order} order\n" in verify(path, system, 1e-12)


def test_own_table_of_another_step_is_verified_with_that_step(workplace, capsys):
    """The last step is shorter."""
    command = "run fig4 --kind native --step 0.03 --stop-time 1 --no-figures --out ours"
    assert main(command.split()) == 0
    assert main(["verify", "ours/result.csv"]) == 2
    capsys.readouterr()
    assert main(["verify", "ours/result.csv", "--step", "0.03", "--tolerance", "0"]) == 0
    assert tells(capsys.readouterr().out, (70, 70, 0, 34, 0.03, 1))


def test_table_of_one_fmu_is_distinguished_from_a_systems(system: System, tmp_path: Path):
    """Most of its columns are the plant's; others have a `fault`, too."""
    path = tmp_path / "table.csv"
    path.write_text("time,fault,eta.x[REAL], y.x\n0,false,2,2\n1,false,2,2\n")
    with pytest.raises(InputError, match=r"only AuvPlant\.fmu, add --scenario AuvPlant\.fmu$"):
        verify(path, system, 1e-6)
    path.write_text("time,depth\n0,2\n1,2\n")
    with pytest.raises(InputError, match=r"named like [\w.]+$"):
        verify(path, system, 1e-6)


def test_table_of_a_tool_that_runs_one_fmu_is_verified(dist, tmp_path, capsys):
    """Its columns have the names of ports, without a component."""
    fmu, table = str(dist / "MotionPlanner.fmu"), tmp_path / "table.csv"
    rows = fmpy.simulate_fmu(fmu, stop_time=1.0, output_interval=0.02)
    write_csv(str(table), rows)
    assert main(["verify", str(table), "--scenario", fmu]) == 0
    assert f"{len(rows.dtype.names) - 1} of " in capsys.readouterr().out
    rows[rows.dtype.names[1]][20] += 1.0
    write_csv(str(table), rows)
    assert main(["verify", str(table), "--scenario", fmu]) == 2
    assert f"MotionPlanner.{rows.dtype.names[1]}" in capsys.readouterr().err


def test_table_of_another_tool_is_understood(system: System, tmp_path: Path):
    """Other separators, a prefix, quotes, Booleans as words, every fifth row, fewer columns."""
    result = run(system, 2.0, 0.02, "jacobi")
    path = tmp_path / "theirs.csv"
    rows = zip(result.time[::5], result["plant.eta.x"][::5], strict=True)
    lines = ['"Time", "auv.plant::eta.x[REAL]","controller.fault","controller.saturation"']
    lines += [f"{t!r}, {x!r},False,tanh" for t, x in ((float(t), float(x)) for t, x in rows)]
    path.write_text("\n".join(lines))
    report = verify(path, system, 1e-9)
    assert tells(report, (2, 70, 1e-9, 20, 0.1, 2)) and "jacobi" in report
    assert "outputs: controller.saturation" in report
    assert mentions(report, "68, plant.eta.y,")


def test_first_port_that_differs_is_named(system: System, tmp_path: Path):
    result = run(system, 2.0, 0.02, "jacobi")
    result.rows[60:, result.columns.index("planner.y_d.z") + 1] += 1e-3
    result.rows[80:, result.columns.index("plant.eta.x") + 1] += 1.0
    write(result, tmp_path / "wrong.csv")
    with pytest.raises(InputError, match=r"planner\.y_d\.z differs first, at t = 1\.2 s") as error:
        verify(tmp_path / "wrong.csv", system, 1e-6)
    assert f"wrong.csv: not a run of {system.name}, which --scenario names: in " in str(error.value)


class OtherTool:
    """A plain loop: it steps one group of components after the other, with whatever is there.

    At the start it exchanges what is there (full), nothing (none), or less than that, as one that
    begins with zeros (zero).
    """

    def __init__(self, system: System, initial: str) -> None:
        self.feeding, self.values = system.feeding, {}
        self.slaves, self.references, self.outputs = {}, {}, {}
        for name, component in system.components.items():
            described = component.description
            slave = FMU2Slave(
                guid=described.guid,
                modelIdentifier=described.coSimulation.modelIdentifier,
                unzipDirectory=str(component.folder),
                instanceName=name,
            )
            slave.instantiate()
            slave.setupExperiment(startTime=0.0)
            self.references[name] = {v.name: v.valueReference for v in described.modelVariables}
            for port, value in system.parameters_of(name).items():
                slave.setReal([self.references[name][port]], [value])
            slave.enterInitializationMode()
            self.slaves[name] = slave
            self.outputs[name] = [v.name for v in component.having("output") if v.type == "Real"]
        # As often as values need to come round.
        for _ in range(5 if initial == "full" else 0):
            for name in self.slaves:
                self.read(name)
            for name in self.slaves:
                self.set(name)
        for name, slave in self.slaves.items():
            slave.exitInitializationMode()
            self.read(name)
        if initial == "zero":
            self.values = dict.fromkeys(self.values, 0.0)

    def read(self, name: str) -> None:
        held = self.slaves[name].getReal([self.references[name][p] for p in self.outputs[name]])
        self.values |= {(name, p): x for p, x in zip(self.outputs[name], held, strict=True)}

    def set(self, name: str) -> None:
        for wire in self.feeding[name]:
            value = self.values[wire.source.component, wire.source.port]
            self.slaves[name].setReal([self.references[name][wire.target.port]], [value])

    def step(self, k: int, group: Sequence[str]) -> None:
        for name in group:
            self.set(name)
        for name in group:
            self.slaves[name].doStep(k * 0.02, 0.02)
        for name in group:
            self.read(name)

    def rows(self, groups: Sequence[Sequence[str]], steps: int = 200) -> list[list[float]]:
        """Time and all values after each step."""
        rows = []
        for k in range(steps):
            for group in groups:
                self.step(k, group)
            rows.append([(k + 1) * 0.02, *self.values.values()])
        return rows

    def write(self, path: Path, rows: Sequence[Sequence[float]]) -> None:
        lines = [",".join(["time", *map(".".join, self.values)])]
        path.write_text("\n".join([*lines, *(",".join(map(repr, row)) for row in rows)]))


def test_table_of_a_tool_that_reads_outputs_after_it_has_passed_them_on_is_certified(
    native: Path, tmp_path: Path
):
    """The others step with earlier values, as PyFMI and ecos do."""
    path, system = tmp_path / "table.csv", closed_loop(native)
    tool, rows = OtherTool(system, "full"), []
    for k in range(200):
        tool.step(k, ORDER)
        passed_on = dict(tool.values)
        for name in ORDER:
            tool.set(name)
        for name in ORDER:
            tool.read(name)
        rows.append([(k + 1) * 0.02, *tool.values.values()])
        tool.values = passed_on
    tool.write(path, rows)
    certified(path, system, "in jacobi order, outputs read after values are passed on")


def test_table_of_a_tool_that_follows_feedthrough_is_certified_before_and_after_it_does(
    native: Path, tmp_path: Path
):
    """OMSimulator writes both rows; the first counts."""
    path, system = tmp_path / "table.csv", closed_loop(native)
    tool, before, after = OtherTool(system, "full"), [], []
    for k in range(200):
        # Values have come round after as many exchanges as there are components.
        for name in ORDER * len(ORDER):
            tool.set(name)
            tool.read(name)
        after.append([k * 0.02, *tool.values.values()])
        for name in ORDER:
            tool.slaves[name].doStep(k * 0.02, 0.02)
        for name in ORDER:
            tool.read(name)
        before.append([(k + 1) * 0.02, *tool.values.values()])
    tool.write(path, after)
    certified(path, system, "in feedthrough order")
    tool.write(path, before)
    certified(path, system, "in feedthrough order, outputs read before values are passed on")
    before[100][1] += 1e-3
    tool.write(path, before)
    with pytest.raises(InputError, match=r"in feedthrough order, .* at t = 2\.02 s"):
        verify(path, system, 1e-9)


def certified(path: Path, system: System, way: str) -> None:
    compared, *_ = verify(path, system, 1e-12).splitlines()
    assert numbers_in(compared)[:2] == [66, 70] and compared.endswith(f" s, {way}")


@pytest.mark.parametrize(
    ("order", "initial"),
    [
        (ORDER, "full"),
        (("planner", *ORDER[:3]), "none"),
        (("planner", "+".join(ORDER[:3])), "zero"),
    ],
)
def test_table_of_a_tool_with_an_order_of_its_own_is_certified(
    native: Path, tmp_path: Path, order: tuple[str, ...], initial: str
):
    path, system = tmp_path / "table.csv", closed_loop(native)
    tool = OtherTool(system, initial)
    tool.write(path, tool.rows([name.split("+") for name in order]))
    report = verify(path, system, 1e-12, order, initial=initial)
    compared, *_ = report.splitlines()
    assert numbers_in(compared)[:6] == [66, 70, 1e-12, 200, 0.02, 4]
    assert ",".join(order) in compared
    assert compared.endswith("outputs") == (initial == "full")
    if initial == "none":
        command = ["verify", str(path), "--tolerance", "1e-12", "--order", ",".join(order)]
        assert main([*command, "--initial", "none"]) == 0
        assert main(command) == 2
    other = "none" if initial == "full" else "full"
    for asked in ({}, {"order": order, "initial": other}, {"order": OTHER_ORDER}):
        with pytest.raises(InputError, match="differs"):
            verify(path, system, 1e-9, **asked)


def test_host_without_initial_exchange_ends_where_the_others_end(native: Path):
    """Zeros in the controller's first step, the true measurement in the second."""

    def end(initial: str, **changes: float) -> np.ndarray:
        values = {PortName("controller", name): value for name, value in changes.items()}
        tool = OtherTool(closed_loop(native).with_parameters(values), initial)
        tool.rows([ORDER], 5000)
        return np.array([tool.values["plant", f"eta.{axis}"] for axis in "xyz"])

    with_exchange = end("full")
    assert np.abs(end("zero") - with_exchange).max() < 1e-3
    # The gate is what makes the difference.
    assert np.abs(end("zero", innovation_gate=0.0) - with_exchange).max() > 1e-2


def test_order_that_names_no_component_or_not_all_is_refused(system: System):
    for order, reason in (
        (("plant", "rudder"), "rudder"), (ORDER[1:], "plant"), ("new", "use one"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=reason):
            verify(COMMITTED / "auv_ref.csv", system, 1e-9, order)


@pytest.mark.parametrize(("prefix", "end"), [("auv.auv.", 4.0), ("a.b.c.d.", 4.000000000000001)])
def test_first_row_of_a_time_counts_and_systems_may_stand_before_a_name(
    system: System, tmp_path: Path, prefix: str, end: float
):
    """A tool writes one row at the end of a step, one after the exchange, and a tiny last step."""
    [_, *names], *rows = cells(COMMITTED / "auv_ref.csv")
    wrong = ["9"] * len(names)
    lines = [["time", *(f"{prefix}{name}" for name in names)]]
    for row in rows:
        lines += [row, [row[0], *wrong]]
    lines.append([repr(end), *wrong])
    path = tmp_path / "table.csv"
    path.write_text("\n".join(map(",".join, lines)))
    compared, passed_over, *_ = verify(path, system, 1e-9).splitlines()
    assert numbers_in(compared) == [70, 70, 1e-9, 200, 0.02, 4]
    assert numbers_in(passed_over) == [202]


def cells(path: Path) -> list[list[str]]:
    with path.open() as lines:
        return [line.rstrip("\n").split(",") for line in lines]


@pytest.mark.parametrize(("separator", "mark"), [(";", ""), ("\t", "\ufeff"), (", ", "")])
def test_table_with_another_separator_and_a_byte_order_mark_is_read(
    system: System, tmp_path: Path, separator: str, mark: str
):
    rows = cells(COMMITTED / "auv_ref.csv")
    path = tmp_path / "table.csv"
    path.write_text(mark + "\r\n".join(map(separator.join, rows)), encoding="utf-8")
    assert tells(verify(path, system, 1e-9), (200, 0.02, 4))


def test_columns_that_were_not_compared_are_named(system: System, tmp_path: Path):
    """The row at the start, inputs, parameters, what looks like a port, and what is missing."""
    rows = cells(COMMITTED / "auv_ref.csv")[:102]
    keep = [rows[0].index(name) for name in ("time", "plant.eta.x", "plant.tau.u", "plant.y.z")]
    rows = [[row[i] for i in keep] for row in rows]
    for i, row in enumerate(rows):
        row += ["plant.eta.X", "comment"] if i == 0 else ["7", "said, nothing"]
    path = tmp_path / "table.csv"
    path.write_text("\n".join(",".join(f'"{cell}"' for cell in row) for row in rows))
    short = verify(path, system, 1e-9).splitlines()
    assert short[4] == (
        "not in the table: 68, such as plant.eta.y, plant.eta.z, plant.eta.phi, plant.eta.theta, "
        "plant.eta.psi (--verbose lists all)"
    )
    compared, *others = verify(path, system, 1e-9, verbose=True).splitlines()
    assert numbers_in(compared) == [2, 70, 1e-9, 100, 0.02, 2]
    assert numbers_in(others[0]) == [0]
    assert tells(others[1], [100])
    assert others[2].endswith("plant.tau.u, plant.eta.X, comment")
    absent = others[3].removeprefix("not in the table: ").split(", ")
    assert len(absent) == 68
    assert not {"plant.eta.x", "plant.y.z"} & set(absent)


@pytest.mark.parametrize("tolerance", [float("nan"), -1e-9, 1.0])
def test_tolerance_that_would_accept_anything_is_refused(system: System, tolerance: float):
    with pytest.raises(InputError, match="tolerance"):
        verify(COMMITTED / "auv_ref.csv", system, tolerance)


def test_own_run_that_fails_certifies_nothing(system: System):
    failing = system.with_parameters({PortName("plant", "nu0.p"): 1e150})
    with pytest.raises(InputError, match="our own run fails"):
        verify(COMMITTED / "auv_ref.csv", failing, 1e-9)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "column time"),
        ("time,plant.eta.x\n0,1\n1,nan\n", "3, plant.eta.x 'nan'"),
        ("time,plant.eta.x\n0,1\n1,\n", "3, plant.eta.x ''"),
        ("time,plant.eta.x\n0,1\n1,\u0661\n", "3, plant.eta.x"),
        ("time;plant.eta.x\n0;1\n1;2,5\n", "'2,5'"),
        ("clock,plant.eta.x\n0,1\n1,2\n", "column time"),
        ("time,Time,plant.eta.x\n0,0,1\n1,1.5,2\n", "line 3 time 1 1.5"),
        ("time,plant.eta.x\n0,1\n0,2\n", "row 0"),
        ("time,plant.eta.x\n0,1\n2,2\n1,2\n", "4: 1 2"),
        ("time,plant.eta.x\n-1,1\n1,2\n", "2: -1"),
        ("time,plant.eta.x\n0,1\nnan,2\n1,2\n", "3, time: 'nan'"),
        ("time,plant.eta.x\n", "row 0"),
        ("time,plant.eta.x\n0,1\n1\n", "3 1 2"),
        ("time,plant.eta.x\n0,1\n\n1,2\n", "3 empty"),
        ('time,plant.eta.x\n0,1\n1,"2"5\n', "expected after"),
        ('time,plant.eta.x\n0,1\n1,"2\n', "end"),
        ('time,plant.eta.x,b\n0,1,"\n1,2,"\n2,1,a\n', "2: quotes"),
        ("time,plant.eta.x,plant::eta.x[REAL]\n0,1,1\n", "2 3 plant.eta.x"),
        ("time,a.b.plant::eta.x,c.plant.eta.x\n0,1,1\n", "2 3 plant.eta.x"),
        ("time,controller.fault\n0,false\n1,maybe\n", "'maybe'"),
    ],
)
def test_table_that_cannot_be_used_is_refused(system, tmp_path, text, reason):
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        verify(path, system, 1e-6)
    assert mentions(str(error.value), reason) and "\n" not in str(error.value)
