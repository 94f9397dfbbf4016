"""Rows and columns that are kept, whatever the blocks in which rows come."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.observers.observer import Ending, Header, Progress, Selection
from orchestrator.cosim.observers.table import Table
from orchestrator.machine.errors import InputError
from orchestrator.machine.texts import matches, matching

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


@pytest.mark.parametrize("kernel", [False, True])
@pytest.mark.parametrize("widgets", [False, True])
def test_bar_is_a_widget_in_a_notebook_that_has_widgets(monkeypatch, kernel, widgets):
    made: list[str] = []

    def module(name: str) -> SimpleNamespace:
        return SimpleNamespace(tqdm=lambda **_: made.append(name))

    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    if kernel:
        monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    where = "orchestrator.machine.lazy"
    monkeypatch.setattr(f"{where}.import_module", module)
    monkeypatch.setattr(f"{where}.find_spec", lambda _: SimpleNamespace() if widgets else None)
    Progress("fig4").begin(Header((), Experiment(1.0, 0.1)))
    assert made == ["tqdm.notebook" if kernel and widgets else "tqdm"]
