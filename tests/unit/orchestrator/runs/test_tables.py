"""Tables of runs and of other tools are read exactly, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestrator.machine.errors import InputError
from orchestrator.runs.tables import read_columns, read_rows


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "it is empty"),
        ("x,y\n1,2\n", "first column is 'x'"),
        ("time,a\n1,2\n3\n", "columns changed"),
        ("time,a\n1,2,3\n4,5,6\n", "rows of 3 values for 2 columns"),
        ("time,a\n0,1\ninf,2\n", "a time is not finite"),
        ("time,a\n1,much\n", "much"),
        ("time,a\n\xff\n", "decode"),
    ],
)
def test_files_that_are_not_tables_are_refused(tmp_path: Path, text: str, why: str):
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


def test_parquet_of_other_tools_is_read_if_it_holds_numbers(tmp_path: Path):
    arrow = pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra `parquet`")
    path = tmp_path / "other.parquet"
    parquet.write_table(arrow.table({"time": [0, 1], "a.b": [True, None]}), path)
    np.testing.assert_array_equal(np.vstack(list(read_rows(path))), [[0, 1], [1, np.nan]])
    parquet.write_table(arrow.table({"time": [0, 1], "a.b": ["x", "y"]}), path)
    with pytest.raises(InputError, match=r"not a table of a run: .*'x'"):
        list(read_rows(path))


def test_a_table_may_have_no_rows(tmp_path: Path):
    path = tmp_path / "empty.csv"
    path.write_text("time,a.b\n\n")
    assert list(read_rows(path)) == []


def test_missing_file_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        read_columns(tmp_path / "missing.csv")


def test_converters_get_texts_unchanged(tmp_path: Path):
    path, texts = tmp_path / "texts.csv", []
    path.write_bytes(b'time,a.s,b.x\n0,"1,""2""",5\n\n1,"two\n\nlines,\r\n",6\n2,,7\n3, x ,8\n')
    [rows] = read_rows(path, {"a.s": lambda text: texts.append(text) or len(texts)})
    np.testing.assert_array_equal(rows, [[0, 1, 5], [1, 2, 6], [2, 3, 7], [3, 4, 8]])
    assert texts == ['1,"2"', "two\n\nlines,\r\n", "", " x "]


def test_the_message_of_a_converter_is_shown(tmp_path: Path):
    def refuse(text: str) -> float:
        raise ValueError(f"a.s: {text} is no colour")

    path = tmp_path / "texts.csv"
    path.write_text("time,a.s\n0,much\n")
    with pytest.raises(InputError) as error:
        list(read_rows(path, {"a.s": refuse}, "not a table of inputs"))
    assert str(error.value) == f"{path}: not a table of inputs: a.s: much is no colour"


def test_a_missing_value_in_parquet_is_refused(tmp_path: Path):
    arrow = pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra `parquet`")
    path = tmp_path / "other.parquet"
    parquet.write_table(arrow.table({"time": [0.0, 1.0], "a.s": ["x", None]}), path)
    with pytest.raises(InputError, match="missing"):
        list(read_rows(path, {"a.s": len}))
