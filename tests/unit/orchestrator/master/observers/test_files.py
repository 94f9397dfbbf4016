"""Tables written as they come, and read again to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestrator.machine.errors import InputError
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.files import FORMATS, read_columns, read_rows
from orchestrator.master.observers.observer import Ending, Header


@pytest.mark.parametrize("ending", FORMATS)
def test_what_is_written_is_read_again_exactly(tmp_path: Path, ending: str):
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"result.{ending}"
    rows = np.random.default_rng(1).normal(scale=1e3, size=(20_001, 4))
    rows[5] = [1e-310, -0.0, 1.7976931348623157e308, np.nextafter(1.0, 2.0)]
    file = FORMATS[ending](path)
    file.begin(Header(("a.x", "a.y", "b.z"), Experiment(1.0, 0.1)))
    for block in np.split(rows, [1, 600, 19_000]):
        file.take(block)
    file.end(Ending())
    assert read_columns(path) == ("a.x", "a.y", "b.z")
    read = list(read_rows(path))
    assert len(read) > 1, "in blocks"
    assert np.vstack(read).tobytes() == rows.tobytes()


def test_parquet_of_the_same_rows_is_the_same_file(tmp_path: Path):
    """However long its observer had to wait for them."""
    pytest.importorskip("pyarrow")
    rows = np.random.default_rng(1).normal(size=(20_000, 2))
    files = []
    for i, block in enumerate((512, 700, 20_000)):
        path = tmp_path / f"{i}.parquet"
        file = FORMATS["parquet"](path)
        file.begin(Header(("a.x",), Experiment(1.0, 0.1)))
        for start in range(0, len(rows), block):
            file.take(rows[start : start + block])
        file.end(Ending())
        files.append(path.read_bytes())
    assert files[0] == files[1] == files[2]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "it is empty"),
        ("x,y\n1,2\n", "first column is 'x'"),
        ("time,a\n1,2\n3\n", "columns changed"),
        ("time,a\n1,2,3\n4,5,6\n", "rows of 3 values below 2 names"),
        ("time,a\n1,much\n", "much"),
        ("time,a\n\xff\n", "decode"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, text: str, why: str):
    path = tmp_path / "odd.csv"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match=f"not a table of a run: .*{why}") as error:
        assert read_columns(path) != list(read_rows(path))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text",
    [
        "time,a.b\n0,1\n1,2",
        '"time","a.b"\n0,1\n1,2\n',
        "time,a.b\r\n0,1\r\n1,2\r\n",
        "\ufefftime,a.b\n\n0,1\n1,2\n\n",
    ],
    ids=["no newline at the end", "quoted names", "Windows", "byte order mark, empty lines"],
)
def test_tables_of_other_tools_are_read(tmp_path: Path, text: str):
    path = tmp_path / "other.csv"
    path.write_text(text, encoding="utf-8", newline="")
    assert read_columns(path) == ("a.b",)
    np.testing.assert_array_equal(np.vstack(list(read_rows(path))), [[0, 1], [1, 2]])


def test_parquet_of_other_tools_is_read_where_it_holds_numbers(tmp_path: Path):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "other.parquet"
    parquet.write_table(arrow.table({"time": [0, 1], "a.b": [True, None]}), path)
    np.testing.assert_array_equal(np.vstack(list(read_rows(path))), [[0, 1], [1, np.nan]])
    parquet.write_table(arrow.table({"time": [0, 1], "a.b": ["x", "y"]}), path)
    with pytest.raises(InputError, match=r"not a table of a run: .*'x'"):
        list(read_rows(path))


def test_a_table_without_rows_has_none(tmp_path: Path):
    path = tmp_path / "empty.csv"
    path.write_text("time,a.b\n\n")
    assert list(read_rows(path)) == []


def test_missing_file_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        read_columns(tmp_path / "missing.csv")
