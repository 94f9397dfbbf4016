"""What a record says of a run is read again as it was, and what no run has written is refused."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.experiment import Experiment
from orchestrator.cosim.observers.observer import Ending, Header, Occurrence
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.machine.errors import InputError
from orchestrator.runs import record
from orchestrator.runs.record import (
    Stopwatch,
    check_gives_states,
    checkpoints_of,
    content_of,
    ending_in,
    header_in,
    in_json,
    leave_checkpoints,
    loops_in,
    read_record,
    read_result,
    write_content,
)
from orchestrator.vehicle.signals import STANDARD, Loop
from support.linear import SINE, linear, system_of
from support.texts import mentions

NUMBERS = st.floats(allow_nan=False)
WORDS = st.text(max_size=20)
NAMES = st.text("abc_", min_size=1, max_size=5)
TIMES = st.floats(0.0, 1e6)

EXPERIMENTS = st.builds(
    Experiment,
    st.floats(1.0, 100.0),
    st.floats(0.01, 1.0),
    st.sampled_from(["jacobi", ("b", "a")]),
    st.floats(0.0, 0.5),
    st.sampled_from([None, "delay"]),
)
HEADERS = st.builds(
    Header,
    st.just(("a.x", "b.y")),
    EXPERIMENTS,
    st.dictionaries(
        st.builds(PortName, NAMES, WORDS.filter(bool)),
        NUMBERS | st.booleans() | WORDS | st.just("-inf"),
    ),
    st.sampled_from(["python", "compiled"]),
    units=st.dictionaries(st.just("a.x"), NAMES),
)
ENDINGS = st.builds(
    Ending,
    st.none() | WORDS,
    st.none() | WORDS,
    st.lists(WORDS).map(tuple),
    events=st.lists(st.builds(Occurrence, TIMES, WORDS, WORDS, st.integers(0, 9))).map(tuple),
)
LOOPS = st.lists(st.builds(Loop, NAMES, NAMES, NAMES, NAMES), min_size=1, max_size=3).map(tuple)


@given(HEADERS, ENDINGS, LOOPS)
def test_all_that_is_written_of_a_table_is_read_again(header, ending, loops):
    content = json.loads(in_json(content_of(header, ending, loops)), parse_constant=pytest.fail)
    found = header_in(content, header.columns)
    assert found == header
    # Equality does not look at these, nor tell 1, 1.0 and True apart.
    assert (found.loop, found.units) == (header.loop, header.units)
    assert repr(found.parameters) == repr(dict(header.parameters))
    assert ending_in(content) == ending
    assert loops_in(content) == loops


def test_a_record_of_a_run_without_vehicles_is_of_the_standard_loop():
    assert loops_in({}) == loops_in({"vehicles": []}) == (STANDARD,)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A result of two rows, and below it another file."""
    (tmp_path / "result.csv").write_text("time,a.x\n0,1\n0.25,2\n")
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "metrics.json").write_text("{}")
    parameters = {PortName("a", "k"): 3.0}
    header = Header(("a.x",), Experiment(1.0, 0.5), parameters, units={"a.x": "m"})
    write_content(tmp_path, content_of(header, Ending("stopped"), [STANDARD]), ["numpy"])
    return tmp_path


def test_a_record_names_files_and_versions(folder):
    content = read_record(folder / "result.csv")
    assert content["files"] == ["below/metrics.json", "result.csv", "run.json"]
    assert content["versions"].keys() == {"python", "numpy"}
    assert content["versions"]["numpy"] == np.__version__


def test_a_table_is_read_with_its_record_or_without(folder):
    drawn = read_result(folder)
    assert np.array_equal(drawn.result.rows, [[0.0, 1.0], [0.25, 2.0]])
    assert (drawn.result.header.experiment.step, drawn.result.failure) == (0.5, "stopped")
    assert drawn.result.header.parameters == {PortName("a", "k"): 3.0}
    (folder / "run.json").unlink()
    drawn = read_result(folder / "result.csv")
    assert (drawn.result.header.experiment.step, drawn.result.header.parameters) == (0.25, {})
    assert (drawn.label, drawn.z_up) == ("result", False)


@pytest.mark.parametrize(
    "change",
    [
        {"files": None}, {"experiment": None}, {"experiment": {"step": 0.5}}, {"events": [{}]},
        {"types": {"a.x": "Real"}}, {"types": ["a.x"]}, {"parameters": {"a.k": [1]}},
        {"parameters": {"a": 1.0}}, {"vehicles": [{"ship": "a"}]}, {"texts": 3},
        {"experiment": {"step": -0.5, "stop_time": 1.0}},
    ],
)  # fmt: skip
def test_a_record_that_no_run_has_written_is_refused_by_name(folder, change):
    file = folder / "run.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    with pytest.raises(InputError, match=r"run\.json"):
        read_record(folder / "result.csv")


@pytest.mark.parametrize("text", ["time,a.x\n", "time,a.x\n0,1\n0,2\n", "time,a.x\n1,1\n0,2\n"])
def test_rows_without_a_step_are_refused(tmp_path, text):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputError, match=r"t\.csv"):
        read_result(tmp_path / "t.csv")


def test_a_run_lasts_as_long_as_it_does_whatever_the_clock_says(monkeypatch):
    monkeypatch.setattr(record, "monotonic", iter([5.0, 7.25]).__next__)
    times = Stopwatch().times()
    assert times["seconds"] == 2.25
    assert datetime.fromisoformat(str(times["started"])).utcoffset() is not None


def test_checkpoints_are_made_only_where_they_are_wanted(tmp_path):
    assert checkpoints_of([], [tmp_path], None, resume=False) == []
    with pytest.raises(InputError) as error:
        checkpoints_of([], [tmp_path / "none"], None, resume=True)
    assert mentions(str(error.value), "none --checkpoint-every")


def test_checkpoints_go_with_a_whole_run_and_else_are_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    removed: list[str] = []

    def kept(name: str, time: float | None) -> SimpleNamespace:
        folder = tmp_path / name
        return SimpleNamespace(folder=folder, time=time, remove=lambda: removed.append(name))

    lines: list[str] = []
    checkpoints = [kept("outer", 2.5), kept("outer/inner", None)]
    leave_checkpoints(checkpoints, False, lines.append)
    [line] = lines
    assert mentions(line, "2.5 outer") and str(tmp_path) not in line and removed == []
    leave_checkpoints(checkpoints, True, lines.append)
    assert removed == ["outer/inner", "outer"] and len(lines) == 1


def test_an_fmu_without_a_state_is_named(tmp_path: Path):
    def system(can: bool) -> System:
        return system_of({"sine": linear(tmp_path, can=can)}, {"sine": SINE}, {})

    check_gives_states(system(can=True))
    with pytest.raises(InputError, match="sine"):
        check_gives_states(system(can=False))
