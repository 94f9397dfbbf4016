"""Values of every type of FMI, also extreme ones, are the same in runs, files and results."""

from __future__ import annotations

import csv
import json
import struct
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from orchestrator import Result, Simulation, read, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import (
    Connection,
    Experiment,
    Linear,
    Mapped,
    PortName,
    Table,
    Value,
    read_ssp,
    write_ssp,
)
from orchestrator.exchange.verify import verify, ways
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.errors import InputError
from support import typed
from support.texts import mentions

H = 0.125

LOOPS = ["compiled", "python"]
TABLES = ["csv", *(["parquet"] if find_spec("pyarrow") else [])]

#: Ranges of the types of FMI; 64 bits around the last integers of a double.
RANGES = {
    "Int8": (-(2**7), 2**7 - 1), "UInt8": (0, 2**8 - 1),
    "Int16": (-(2**15), 2**15 - 1), "UInt16": (0, 2**16 - 1),
    "Int32": (-(2**31), 2**31 - 1), "UInt32": (0, 2**32 - 1),
    "Int64": (-(2**63), 2**63 - 1), "UInt64": (0, 2**64 - 1),
}  # fmt: skip
ITEMS = {"calm": 1, "storm": 4}

#: Texts that are difficult in tables.
TEXTS = (
    "", " ", " a ", "a,b", '"', '""', "a\nb", "a\n\nb", "\n", "a\rb", "\r\n", "inf", "1.0", "true",
    "#", "\t", "\x1c", "\ufeff", "\ufffe", "\U0001f30a", "time",
)  # fmt: skip


def _integers(kind: str) -> st.SearchStrategy[int]:
    least, most = RANGES[kind]
    near = [2**53 - 1, 2**53, 2**53 + 1, -(2**53) - 1, least, least + 1, most - 1, most, 0]
    return st.sampled_from([n for n in near if least <= n <= most]) | st.integers(least, most)


#: Values of the inputs of `typed`; it refuses a step with a negative Float64.
VALUES: dict[str, st.SearchStrategy[Value]] = {
    "Float64": st.sampled_from([0.0, 5e-324, 1e300, 0.1]) | st.floats(0.0, 1e300),
    "Float32": st.floats(width=32, allow_nan=False, allow_infinity=False),
    **{kind: _integers(kind) for kind in RANGES},
    "Enumeration": st.sampled_from([*ITEMS.values()]),
    "Boolean": st.booleans(),
    "String": st.sampled_from(TEXTS)
    | st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20),
}
ROW = st.fixed_dictionaries(VALUES)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return typed.build(tmp_path_factory.mktemp("typed"))


def cell(kind: str, value: Value) -> str:
    """A value as a user writes it into a table."""
    if kind == "Enumeration":
        return {1: "calm", 4: "4"}[int(value)]
    return str(value).lower() if kind == "Boolean" else str(value)


def write_inputs(path: Path, rows: Sequence[dict[str, Value]]) -> None:
    """A table of inputs: a row for each step."""
    if path.suffix == ".csv":
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, quoting=csv.QUOTE_ALL)
            writer.writerow(["time", *(f"a.u_{kind}" for kind in VALUES)])
            for k, row in enumerate(rows):
                writer.writerow([k * H, *(cell(kind, row[kind]) for kind in VALUES)])
        return
    arrow = pytest.importorskip("pyarrow")
    types = {"Float64": "float64", "Float32": "float32", "Boolean": "bool_", "String": "string"}
    types |= {"Enumeration": "int8", **{kind: kind.lower() for kind in RANGES}}
    columns = {"time": arrow.array([k * H for k in range(len(rows))], arrow.float64())}
    for kind, type_ in types.items():
        columns[f"a.u_{kind}"] = arrow.array([row[kind] for row in rows], getattr(arrow, type_)())
    pytest.importorskip("pyarrow.parquet").write_table(arrow.table(columns), path)


def check(result: Result, rows: Sequence[dict[str, Value]]) -> None:
    """Compare each row with the table of inputs at its time."""
    for kind in VALUES:
        expected = [rows[min(k, len(rows) - 1)][kind] for k in range(len(rows) + 1)]
        for port in (f"a.u_{kind}", f"a.y_{kind}"):
            assert result[port].tolist() == expected, port
    assert result["a.joined[2]"].tolist() == [f"b{rows[min(k, 2)]['String']}" for k in range(4)]


@given(rows=st.lists(ROW, min_size=3, max_size=3), data=st.data())
@settings(max_examples=6, deadline=None)
def test_a_column_is_what_the_fmu_has_wherever_it_is_read(fmu: Path, rows, data):
    ending, loop = (
        data.draw(st.sampled_from(TABLES)),
        data.draw(st.sampled_from(["auto", "python"])),
    )
    with TemporaryDirectory() as place:
        folder = Path(place)
        write_inputs(folder / f"in.{ending}", rows)
        made = simulate(
            typed.system_of(fmu), stop_time=3 * H, step=H, loop=loop,
            inputs=folder / f"in.{ending}",
        )  # fmt: skip
        check(made, rows)
        for kind in TABLES:
            stored = read(made.save(folder / kind, format=kind))
            check(stored, rows)
            again = read(stored.save(folder / f"again-{kind}"))
            check(again, rows)
            assert again.columns == made.columns
            assert [again[c].dtype.kind for c in made.columns] == [
                made[c].dtype.kind for c in made.columns
            ]
        # A run can take the table of another one as inputs.
        write = folder / "csv" / "result.csv"
        lines = list(csv.reader(write.open(encoding="utf-8", newline="")))
        places = [0, *(i for i, name in enumerate(lines[0]) if name.startswith("a.u_"))]
        with (folder / "twice.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, quoting=csv.QUOTE_ALL)
            writer.writerows([line[i] for i in places] for line in lines)
        twice = simulate(typed.system_of(fmu), stop_time=3 * H, step=H, inputs=folder / "twice.csv")
        check(twice, rows)


def test_a_data_frame_has_the_types_of_its_columns(fmu: Path, tmp_path: Path):
    pytest.importorskip("pandas", reason="needs the extra `docs`")
    values = {f"a.u_{kind}": value for kind, value in typed.VALUES.items()}
    made = simulate(typed.system_of(fmu, parameters=values), stop_time=2 * H, step=H)
    for result in (made, read(made.save(tmp_path / "r"))):
        frame = result.to_dataframe()
        assert tuple(frame.columns) == result.columns
        for kind, value in typed.VALUES.items():
            assert frame[f"a.y_{kind}"].tolist() == [value] * 3
        assert frame.dtypes["a.y_Int64"] == np.int64 and frame.dtypes["a.counter"] == np.uint64


def test_a_run_with_infinite_parameters_is_read_and_drawn(fmu: Path, tmp_path: Path):
    """Nothing sets `end_at`, which the FMU has at infinity; a text may look like a number."""
    system = typed.system_of(fmu, parameters={"a.names[1]": "inf", "a.names[2]": "1.0"})
    made = simulate(system, stop_time=2 * H, step=H)
    folder = made.save(tmp_path / "r")
    record = json.loads((folder / "run.json").read_text(), parse_constant=pytest.fail)
    assert record["parameters"]["a.end_at"] == "inf"
    stored = read(folder)
    for result in (made, stored, read(stored.save(tmp_path / "s"))):
        assert result.parameters["a.end_at"] == inf
        assert (result.parameters["a.names[1]"], result.parameters["a.names[2]"]) == ("inf", "1.0")
        assert dict(result.parameters) == dict(made.parameters)
        # Texts are not drawn.
        with pytest.raises(ValueError, match="no column matches"):
            result.plot("a.y_String")
    for result in (made, stored):
        axes = result.plot("a.y_*nt64", "a.counter").axes
        assert [axis.get_ylabel() for axis in axes] == ["a.counter", "a.y_Int64", "a.y_UInt64"]
    arguments = ["plot", str(folder), "a.u_*n*", "--out", str(tmp_path / "plot.png")]
    assert main(arguments) == 0
    # Earlier versions wrote invalid JSON.
    (folder / "run.json").write_text((folder / "run.json").read_text().replace('"inf"', "Infinity"))
    with pytest.warns(UserWarning, match="changed"):
        assert read(folder).parameters["a.end_at"] == inf


def test_a_long_run_is_drawn_whatever_its_types(fmu: Path):
    """Means are taken of more rows than are drawn, and no text has one."""
    values = {"a.counts_from": 2**53 - 9, "a.u_String": "said"}
    made = simulate(typed.system_of(fmu, parameters=values), stop_time=21.0, step=1e-3)
    seen = VisibleRows(["a.counter"])
    seen.begin(made.header)
    seen.take(made.rows)
    seen.end(made.ending)
    assert "a.y_String" not in seen and seen.means is not None
    assert seen["a.counter"].tolist()[0] == 2**53 - 9
    assert abs(seen.means["a.counter"][-1] - made["a.counter"].astype(float)[-1]) < 300


@pytest.mark.parametrize(
    ("kind", "text"),
    [("Enumeration", "stormy"), ("Enumeration", "2"), ("Boolean", "0.5"), ("Int64", "1e30"),
     ("Int8", "1.5x"), ("Float64", "x")],
)  # fmt: skip
def test_a_cell_that_its_column_cannot_hold_is_refused_by_name(fmu: Path, tmp_path, kind, text):
    """The message names the file once, and the column, as `--set` would."""
    file = tmp_path / "in.csv"
    file.write_text(f"time,a.u_{kind}\n0,1\n0.1,{text}\n")
    with pytest.raises(InputError) as error:
        simulate(typed.system_of(fmu), stop_time=H, step=H, inputs=file)
    line = str(error.value)
    assert line.startswith(f"{file}: ") and line.count("in.csv") == 1
    assert "\n" not in line and "a table of a run" not in line
    assert text.removesuffix("e30") in line or kind in line


def test_recorded_inputs_of_32_bits_are_what_the_fmu_has(fmu: Path):
    """Also after a unit, an event or a table has changed them; expected by IEEE 754's rounding."""
    wires = {"b.u_Float32": "a.y_Float32"}
    system = typed.system_of(fmu, "ab", wires, {"a.u_Float32": 0.1})
    [wire] = system.connections
    system = replace(system, connections=(replace(wire, transformation=Linear(1 / 3, 0.01)),))

    def rounded(value: float) -> float:
        return struct.unpack("f", struct.pack("f", value))[0]

    arriving = rounded(rounded(0.1) * (1 / 3) + 0.01)
    for how in ({"loop": LOOPS[0]}, {"loop": "python"}, {"isolate": True}):
        events = [{"at": 2 * H, "bias": {"b.u_Float32": 1e-3}}]
        result = simulate(system, stop_time=4 * H, step=H, events=events, **how)
        assert result["b.u_Float32"].tolist() == result["b.y_Float32"].tolist()
        assert result["b.u_Float32"][1] == arriving != rounded(0.1) * (1 / 3) + 0.01


WIDE = st.sampled_from(["Int64", "UInt64"]).flatmap(
    lambda kind: st.tuples(
        st.just(kind),
        st.lists(_integers(kind), min_size=1, max_size=4, unique=True),
        st.lists(_integers(kind), min_size=4, max_size=4),
        _integers(kind),
    )
)


@given(drawn=WIDE, how=st.sampled_from([{"loop": loop} for loop in LOOPS]))
@example(("UInt64", [2**64 - 1], [2**53 + 1], 0), {"isolate": True})
@example(("Int64", [2**53 + 1], [-(2**63)], 2**53), {"loop": LOOPS[0]})
@settings(max_examples=4, deadline=None)
def test_integers_of_64_bits_are_mapped_exactly(fmu: Path, drawn, how):
    """Sources and targets may be beyond the integers of doubles."""
    kind, sources, targets, other = drawn
    pairs = tuple(zip(sources, targets, strict=False))
    with TemporaryDirectory() as place:
        for value in (sources[0], other):
            system = typed.system_of(fmu, "ab", parameters={f"a.u_{kind}": value})
            ends = PortName.read(f"a.y_{kind}"), PortName.read(f"b.u_{kind}")
            system = replace(system, connections=(Connection(*ends, Mapped(pairs)),))
            [path] = write_ssp(system, Path(place))
            read_again = read_ssp(path)
            assert read_again.connections == system.connections
            result = simulate(read_again, stop_time=2 * H, step=H, **how)
            assert result[f"b.y_{kind}"].tolist() == [dict(pairs).get(value, value)] * 3


@pytest.mark.parametrize("target", [2**63, -1, 2**64])
def test_a_mapping_to_what_its_target_cannot_hold_is_refused_by_its_number(fmu: Path, target: int):
    kind = "Int64" if target == 2**63 else "UInt64"
    system = typed.system_of(fmu, "ab")
    ends = PortName.read(f"a.y_{kind}"), PortName.read(f"b.u_{kind}")
    system = replace(system, connections=(Connection(*ends, Mapped(((0, target),))),))
    assert mentions(" ".join(map(str, system.problems())), f"{target} {kind}")


@pytest.mark.parametrize("rows", [1, 3])
def test_large_integers_are_verified_in_blocks_of_any_size(fmu: Path, tmp_path: Path, rows: int):
    """On a busy machine observers get rows in small blocks."""
    values = {f"a.u_{kind}": value for kind, value in typed.VALUES.items()}
    system = replace(typed.system_of(fmu, parameters=values), step=H)
    table = simulate(system, stop_time=4 * H).save(tmp_path) / "result.csv"
    with patch("orchestrator.cosim.observers._ROWS", rows):
        verify(table, system, 0.0)


def test_outputs_read_on_the_other_side_of_the_exchange_are_in_their_columns(fmu: Path):
    """Constant inputs: their copies are the same on both sides."""
    system = typed.system_of(fmu, parameters={f"a.u_{k}": v for k, v in typed.VALUES.items()})
    table, [way] = Table(), ways(system, "jacobi", "full")
    way.turn().run(system, Experiment(4 * H, H), table)
    for kind, value in typed.VALUES.items():
        assert table[f"a.y_{kind}"].tolist() == [value] * len(table), kind
    assert len(table) > 3


@pytest.mark.parametrize("loop", LOOPS)
def test_a_simulation_reads_every_column(fmu: Path, loop: str):
    values = {f"a.u_{kind}": value for kind, value in typed.VALUES.items()}
    with Simulation(typed.system_of(fmu, parameters=values), step=H, loop=loop) as sim:
        sim.step()
        for kind, value in typed.VALUES.items():
            assert sim[f"a.u_{kind}"] == sim[f"a.y_{kind}"] == value, kind
