"""Rows that are kept and written, whatever the blocks in which they come."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.experiment import Experiment, Order
from orchestrator.cosim.observers import Ending, Header, Selection, Table, TableFile
from orchestrator.machine.errors import InputError
from orchestrator.machine.texts import matches, matching
from orchestrator.runs.tables import read_columns, read_rows

COLUMNS = ("a.x", "a.y", "b.k[1]", "b.k[2]")
CUTS = st.lists(st.integers(1, 999), max_size=5)
HEADER = Header(COLUMNS, Experiment(10.0, 0.01))


def selected(n: int, cuts: list[int], interval: float | None, columns=None) -> Table:
    rows = np.arange(n)[:, np.newaxis] * np.array([0.01, 1.0, 2.0, 3.0, 4.0])
    table = Table()
    selection = Selection(table, interval, columns)
    selection.begin(HEADER)
    for block in np.split(rows, sorted(cuts)):
        if len(block):
            selection.take(block)
    selection.end(Ending())
    return table


@given(
    n=st.integers(2, 1000),
    cuts=st.lists(st.integers(1, 999), max_size=5),
    every=st.integers(1, 300),
)
def test_one_row_is_kept_for_each_interval_and_the_last(n, cuts, every):
    kept = selected(n, cuts, every * 0.01)
    expected = sorted({*range(0, n, every), n - 1})
    np.testing.assert_allclose(kept["a.x"], expected)


@given(cuts=CUTS)
def test_an_interval_between_steps_keeps_the_first_row_beyond(cuts):
    """0.025 s in steps of 0.01 s: rows 0, 3, 5, 8, 10, ..."""
    kept = selected(500, cuts, 0.025)
    assert kept["a.x"][:5].tolist() == [0, 3, 5, 8, 10]


def test_columns_are_kept_in_the_order_that_was_asked_for():
    kept = selected(3, [], None, ["b.k[2]", "a.x"])
    assert kept.columns == ("b.k[2]", "a.x")
    assert kept.rows.tolist() == [[0.0, 0.0, 0.0], [0.01, 4.0, 1.0], [0.02, 8.0, 2.0]]


@pytest.mark.parametrize("interval", [0.0, -1.0, float("nan")])
def test_impossible_interval_is_refused(interval):
    with pytest.raises(InputError, match="must be positive"):
        Selection(Table(), interval)


def test_patterns_are_names_groups_and_wildcards():
    assert matching(COLUMNS, ["b.k[*]", "a.x"]) == ["a.x", "b.k[1]", "b.k[2]"]
    assert matching(COLUMNS, ["a"]) == ["a.x", "a.y"]
    assert not matches("a.xy", "a.x")
    with pytest.raises(InputError, match=r"no column matches 'a\.z'; did you mean a\."):
        matching(COLUMNS, ["a.z"])


def table(times: list[float], order: Order = "gauss-seidel") -> Table:
    """`a.t` holds the time; `a.start` the time at which the step of the row began, 0.1 s before."""
    t = np.array(times)
    header = Header(("a.t", "a.start"), Experiment(10.0, 0.1, order), {PortName("a", "gain"): 2.0})
    return Table.of(header, np.column_stack([t, t, t - 0.1]))


def test_values_of_a_step_belong_to_the_time_at_which_it_began():
    whole = table([0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(whole.step_start, whole.step_values("a.start")[:, 0], atol=1e-15)
    np.testing.assert_allclose(whole.start_values("a.t")[:, 0], whole.step_start)


def test_steps_keep_their_times_where_rows_were_left_out():
    thinned = table([0.0, 0.1, 1.0, 1.1, 2.0])
    np.testing.assert_allclose(thinned.step_start, [0.0, 0.9, 1.0, 1.9])
    # The row before 1.0 is missing: the values of the row itself are used, a step later.
    np.testing.assert_allclose(thinned.start_values("a.t")[:, 0], [0.0, 1.0, 1.0, 2.0])


def test_without_a_lag_the_row_of_a_time_shows_the_values_of_its_step():
    """The last row begins no step; after left-out rows each row has its own time."""
    for times in ([0.0, 0.1, 0.2, 0.3], [0.0, 0.1, 1.0, 1.1, 2.0]):
        whole = table(times, "feedthrough")
        assert whole.step_start.tolist() == times[:-1]
        assert whole.step_values("a.t")[:, 0].tolist() == times[:-1]
        assert whole.start_values("a.t")[:, 0].tolist() == times[:-1]


def test_unknown_column_has_a_suggestion():
    with pytest.raises(KeyError, match=r"did you mean a\.start"):
        table([0.0])["a.strat"]


def test_groups_and_patterns_are_columns_side_by_side_in_their_order():
    """`expected` is from the places of the columns in the rows."""
    rows = np.arange(10.0).reshape(2, 5)
    kept = Table.of(HEADER, rows)
    for name, places in (("a", [1, 2]), ("b.k", [3, 4]), ("*.k[*]", [3, 4]), ("b.k[2]", [4])):
        assert name in kept
        assert np.array_equal(kept[name].reshape(2, -1), rows[:, places])
    assert np.array_equal(kept.group("b.k", "time", "a.x"), rows[:, [3, 4, 0, 1]])
    assert kept["a.x"].ndim == 1 and kept["b.k[2*"].shape == (2, 1)
    assert dict(kept).keys() == {*COLUMNS} and [*kept] == [*COLUMNS]
    for name in ("c", "a.", "a.xy", "", 0):
        assert name not in kept
        with pytest.raises(KeyError):
            kept[name]
    with pytest.raises(KeyError, match=r"no column or group 'b\.kk'; did you mean b\.k"):
        kept["b.kk"]
    assert kept.missing(["b.k", "a.x", "time"]) == ["b.k"]


def test_a_group_of_texts_and_numbers_is_refused():
    header = Header(
        ("a.x", "a.word", "a.words[1]"),
        Experiment(1.0, 1.0),
        types={"a.word": "String", "a.words[1]": "String"},
    )
    number = header.strings.number("high")
    kept = Table.of(header, np.array([[0.0, 1.5, number, number]]))
    assert kept["a.words"].tolist() == [["high"]]
    assert kept.group("a.word", "a.words").tolist() == [["high", "high"]]
    with pytest.raises(InputError, match=r"a\.x, a\.word.*texts and numbers"):
        kept["a"]
    again = pickle.loads(pickle.dumps(kept))
    assert again["a.word"].tolist() == ["high"]


def test_missing_names_what_is_not_there():
    assert table([0.0]).missing(["a.t", "b.x"], ["a.gain", "a.loss"]) == ["b.x", "a.loss"]


def test_more_rows_than_fit_are_refused_before_the_run():
    with pytest.raises(InputError, match="do not fit into memory"):
        Table().begin(Header(("a.t",), Experiment(1e6, 0.01)))


@pytest.mark.parametrize("ending", TableFile.FORMATS)
def test_what_is_written_is_read_again_exactly(tmp_path: Path, ending: str):
    if ending == "parquet":
        pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    path = tmp_path / f"result.{ending}"
    rows = np.random.default_rng(1).normal(scale=1e3, size=(20_001, 4))
    rows[5] = [1e-310, -0.0, 1.7976931348623157e308, np.nextafter(1.0, 2.0)]
    file = TableFile.at(path)
    file.begin(Header(("a.x", "a.y", "b.z"), Experiment(1.0, 0.1)))
    for block in np.split(rows, [1, 600, 19_000]):
        file.take(block)
    file.end(Ending())
    assert read_columns(path) == ("a.x", "a.y", "b.z")
    read = list(read_rows(path))
    assert len(read) > 1, "in blocks"
    assert np.vstack(read).tobytes() == rows.tobytes()


def test_parquet_of_the_same_rows_is_the_same_file(tmp_path: Path):
    """In blocks of any size."""
    pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    rows = np.random.default_rng(1).normal(size=(20_000, 2))
    files = []
    for i, block in enumerate((512, 700, 20_000)):
        path = tmp_path / f"{i}.parquet"
        file = TableFile.at(path)
        file.begin(Header(("a.x",), Experiment(1.0, 0.1)))
        for start in range(0, len(rows), block):
            file.take(rows[start : start + block])
        file.end(Ending())
        files.append(path.read_bytes())
    assert files[0] == files[1] == files[2]
