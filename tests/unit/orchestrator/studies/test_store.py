"""Outcomes of a study in its folder."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Mapping
from itertools import chain, pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.machine.errors import InputError
from orchestrator.studies import store as store_module
from orchestrator.studies.columns import Case, Outcome, Outcomes, Points, Texts
from orchestrator.studies.store import StudyResult, open_store, read_study_record
from orchestrator.vehicle.indices import index_columns
from support.machine import contents, eventually

parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra `studies`")

RECORD = {"study": "mine", "runs": 4, "made_of": {"points": "1234", "scenario": ("fig4",)}}


class Toys:
    """A space of one value, the number of the run times a tenth."""

    def __init__(self, runs: int):
        self.runs = runs
        self.columns = {"toy.x": float, "toy.name": str}
        self.has_scenarios = True

    def __len__(self):
        return self.runs

    def points(self, numbers: np.ndarray) -> Points:
        names = np.array([str(number) for number in numbers], dtype=object)
        values = {"toy.x": 0.1 * numbers, "toy.name": names}
        ones = np.ones(len(numbers))
        cases = [Case("scenario 0", {}), Case("scenario 1", {})]
        return Points(numbers, cases, numbers % 2, values, ones, ones)


def outcome(number: int) -> Outcome:
    return Outcome(number, {name: 0.3 * number + i for i, name in enumerate(index_columns())})


def outcomes(*each: Outcome) -> Outcomes:
    return Outcomes.of(each)


def check_refused(words: str, folder: Path, record: Mapping[str, Any] = RECORD):
    with pytest.raises(InputError, match=words), open_store(folder, record, index_columns()):
        raise AssertionError


def test_outcomes_are_kept_and_the_others_are_missing(tmp_path):
    with open_store(tmp_path / "new", RECORD, index_columns()) as first:
        assert missing(first, 6) == [[0, 1], [2, 3], [4, 5]]
        first.add(outcomes(outcome(4), outcome(1)))
    with open_store(tmp_path / "new", RECORD, index_columns()) as second:
        assert len(second) == 2
        assert missing(second, 6) == [[0, 2], [3, 5]]
        blocks = second.missing(6).blocks(1)
        next(blocks)
        # New outcomes do not change an iteration.
        second.add(outcomes(outcome(2), outcome(4)))
        assert [*chain(*blocks)] == [2, 3, 5]
        assert len(second) == 3
        second.add(outcomes(outcome(4)))
        assert len(second) == 3


def test_table_has_all_runs_in_their_order_to_the_last_bit(tmp_path):
    odd = dict.fromkeys(index_columns(), 0.1 + 0.2) | {"late_error": -0.0, "largest_speed": np.inf}
    del odd["time_to_reach"]
    stopped = Outcome(1, {}, "stopped at t = 1 s: it would", "chattering")
    with open_store(tmp_path, RECORD, index_columns()) as unfinished:
        unfinished.add(outcomes(outcome(3), stopped, outcome(2)))
        unfinished.add(outcomes(Outcome(0, odd)))
        unfinished.publish(Toys(4))
    assert contents(tmp_path).keys() == {"runs.parquet", "study.json"}
    table = parquet.read_table(tmp_path / "runs.parquet")
    names = ["run", "scenario", "toy.x", "toy.name", *index_columns(), "failure", "caution"]
    assert table.column_names == names
    rows = table.to_pylist()
    assert [row["run"] for row in rows] == [0, 1, 2, 3]
    assert [row["failure"] for row in rows] == [None, "stopped at t = 1 s: it would", None, None]
    assert [row["caution"] for row in rows] == [None, "chattering", None, None]
    for number, row in enumerate(rows):
        expected = (f"scenario {number % 2}", 0.1 * number, str(number))
        assert (row["scenario"], row["toy.x"], row["toy.name"]) == expected
    assert rows[2] | outcome(2).indices == rows[2]
    assert all(rows[1][name] is None for name in index_columns())
    assert rows[0]["time_to_reach"] is None
    assert np.signbit(rows[0].pop("late_error"))
    assert rows[0] | {k: v for k, v in odd.items() if k != "late_error"} == rows[0]


@settings(max_examples=max(settings.default.max_examples // 5, 5))
@given(st.permutations(range(60)), st.sets(st.integers(1, 59), max_size=12))
def test_blocks_come_in_any_order_and_may_overlap(numbers, cuts):
    """Refused runs that are repeated make such blocks; only some are in memory."""
    with TemporaryDirectory() as folder, patch.object(store_module, "_ROWS", 7):
        with open_store(Path(folder), RECORD, ["late_error"]) as unfinished:
            for first, end in pairwise([0, *sorted(cuts), 60]):
                block = [Outcome(i, {"late_error": 0.3 * i}) for i in numbers[first:end]]
                unfinished.add(outcomes(*block))
            unfinished.publish(Toys(60))
        table = parquet.read_table(Path(folder, "runs.parquet"))
    assert table["run"].to_pylist() == [*range(60)]
    assert table["late_error"].to_pylist() == [0.3 * i for i in range(60)]


def test_memory_does_not_grow_with_the_number_of_runs(tmp_path, monkeypatch):
    """Neither while runs are added and published nor while they are counted."""
    monkeypatch.setattr(store_module, "_ROWS", size := 500)

    def peak(blocks: int) -> int:
        folder, record = tmp_path / str(blocks), RECORD | {"runs": size * blocks}
        tracemalloc.start()
        with open_store(folder, record, index_columns()) as unfinished:
            for numbers in unfinished.missing(size * blocks).blocks(size):
                values = np.full((size, len(index_columns())), 0.1)
                texts = Texts.where(numbers % 7 == 0, "chattering")
                made = Outcomes(numbers, index_columns(), values, Texts.of([None] * size), texts)
                unfinished.add(made)
            unfinished.publish(Toys(size * blocks))
        assert StudyResult(folder).cautions["chattering"] == -(-size * blocks // 7)
        largest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return largest

    peak(1)
    assert peak(24) < 1.1 * peak(6)


def test_result_gives_columns_and_suggests_names(tmp_path):
    with open_store(tmp_path, RECORD | {"runs": 2}, index_columns()) as unfinished:
        wary = outcome(1)._replace(cautions="unstable observer, chattering")
        unfinished.add(outcomes(wary, Outcome(0, {}, "it would not", "chattering")))
        unfinished.publish(Toys(2))
    result = StudyResult(tmp_path)
    assert (result.runs, result.failed) == (2, 1)
    assert result.cautions == {"chattering": 2, "unstable observer": 1}
    assert np.isnan(result["late_error"][0])
    assert result["late_error"][1] == outcome(1).indices["late_error"]
    assert list(result["failure"]) == ["it would not", None]
    assert dict(result).keys() == set(result)
    assert result.record == read_study_record(tmp_path)
    assert repr(result) == f"<StudyResult {tmp_path.name}: 2 runs, 1 failed>"
    with pytest.raises(KeyError, match="no column 'late_eror'; did you mean late_error"):
        result["late_eror"]
    with pytest.raises(InputError, match="holds no finished study"):
        StudyResult(tmp_path / "elsewhere")


def test_study_that_is_done_is_not_opened_again(tmp_path):
    with open_store(tmp_path, RECORD | {"runs": 1}, index_columns()) as unfinished:
        unfinished.add(outcomes(outcome(0)))
        unfinished.publish(Toys(1))
    with open_store(tmp_path, RECORD, index_columns()) as unfinished:
        assert unfinished.is_done
    assert not (tmp_path / "unfinished.sqlite").exists()


def systems(*identities):
    return {"made_of": {"systems": [*identities]}}


@pytest.mark.parametrize(
    ("before", "now", "words"),
    [
        (RECORD, {"made_of": {"points": "5678", "scenario": ["fig4"], "step": 0.01}},
         "points, step"),
        (systems({"the code": "1", "step": "2"}), systems({"the code": "1", "step": "3"}), "step"),
        (systems({"step": "1"}, {"step": "1"}), systems({"step": "2"}, {"order": "3"}),
         "step, order"),
        (systems({"step": "1"}), systems({"step": "1"}, {"step": "1"}), "systems"),
        # The record of an earlier version.
        ({"made_of": {"systems": "1234"}}, systems({"step": "1"}), "systems"),
    ],
)  # fmt: skip
def test_another_study_is_refused_with_the_differences(tmp_path, before, now, words):
    with open_store(tmp_path, before, index_columns()):
        pass
    check_refused(f"another study, which differs in {words}; choose", tmp_path, now)
    assert read_study_record(tmp_path) == json.loads(json.dumps(before))


def test_folder_is_for_one_process(tmp_path):
    with open_store(tmp_path, RECORD, index_columns()):
        check_refused("another run is writing into", tmp_path)


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("study.json", "["),
        ("study.json", "{}"),
        ("runs.parquet", ""),
        ("unfinished.sqlite", "no database" * 100),
        ("unfinished.sqlite-wal", "mine"),
    ],
)
def test_files_of_the_user_are_refused(tmp_path, file, content):
    (tmp_path / file).write_text(content)
    check_refused("is not a file that auv-fmu wrote", tmp_path)
    assert (tmp_path / file).read_text() == content


def test_a_damaged_database_and_a_file_as_folder_are_one_line(tmp_path):
    with open_store(tmp_path / "study", RECORD, index_columns()):
        pass
    (tmp_path / "study" / "unfinished.sqlite").write_bytes(b"no database" * 1000)
    check_refused(r"unfinished\.sqlite is not a file that auv-fmu wrote", tmp_path / "study")
    (tmp_path / "file").touch()
    check_refused("cannot write into .*choose another place", tmp_path / "file")


def missing(store, n: int) -> list[list[int]]:
    return [block.tolist() for block in store.missing(n).blocks(2)]


BLOCK = 50

WRITER = f"""
import sys
from itertools import count
from pathlib import Path
from orchestrator.studies.columns import Outcome, Outcomes
from orchestrator.studies.store import open_store
from orchestrator.vehicle.indices import index_columns

with open_store(Path(sys.argv[1]), {RECORD!r}, index_columns()) as unfinished:
    for block in count(len(unfinished) // {BLOCK}):
        runs = range({BLOCK} * block, {BLOCK} * (block + 1))
        unfinished.add(Outcomes.of([Outcome(number, {{}}, str(number)) for number in runs]))
"""


@pytest.mark.slow
def test_kill_loses_at_most_the_block_under_way(tmp_path):
    done = 0
    for _ in range(3):
        process = subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path)])
        log = tmp_path / "unfinished.sqlite-wal"
        assert eventually(lambda log=log: log.exists() and log.stat().st_size > 100_000)
        process.send_signal(signal.SIGKILL)
        process.wait()
        with open_store(tmp_path, RECORD, index_columns()) as unfinished:
            assert len(unfinished) > done
            done = len(unfinished)
            # All of a block, or none.
            assert done % BLOCK == 0
            assert missing(unfinished, done + 2) == [[done, done + 1]]
