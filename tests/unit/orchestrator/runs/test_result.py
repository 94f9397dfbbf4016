"""`Result`, its record and its files are the same after they are read."""

from __future__ import annotations

import json
import multiprocessing
import pickle
import shutil
from concurrent.futures import ProcessPoolExecutor
from copy import deepcopy
from datetime import datetime
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import orchestrator
from orchestrator import Result, load, read, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import Ending, Experiment, Header, Occurrence, PortName
from orchestrator.figures.drawing import save
from orchestrator.machine.compilers import find_compiler
from orchestrator.machine.errors import InputError
from orchestrator.runs.result import (
    Stopwatch,
    content_of,
    ending_in,
    header_in,
    in_json,
    loops_in,
    read_record,
    read_result,
    write_content,
)
from orchestrator.vehicle.signals import STANDARD, Loop
from support.tiers import slow


@pytest.fixture(scope="module")
def result() -> Result:
    return simulate("fig4", stop_time=0.1)


@pytest.fixture(scope="module")
def failed() -> Result:
    with pytest.warns(UserWarning, match="planner is set for another vehicle"):
        failed = simulate("fig4", {"plant.d11": 1e4})
    assert failed.failure is not None
    return failed


def test_package_shows_its_names():
    names = {
        *("Result", "Simulation", "SimulationFailed", "Simulations", "StudyResult"),
        *("load", "read", "simulate", "sweep"),
    }
    assert set(orchestrator.__all__) == names <= set(dir(orchestrator))
    assert {getattr(orchestrator, name).__name__ for name in names} == names
    assert not hasattr(orchestrator, "nothing")


def test_stored_result_is_the_same_again(result, tmp_path):
    for ending in ("csv", "parquet"):
        if ending == "parquet":
            pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
        again = read(result.save(tmp_path / ending, format=ending))
        assert np.array_equal(again.rows, result.rows)
        assert (again.columns, again.failure, repr(again)) == (result.columns, None, repr(result))
        assert dict(again.parameters) == dict(result.parameters)
        assert again.metrics() == result.metrics()
        # A result that was read can be saved, too.
        twice = read(again.save(tmp_path / f"again-{ending}", format="csv"))
        assert np.array_equal(twice.rows, result.rows)
        assert twice.metrics() == result.metrics()
        with pytest.raises(ValueError, match=r"a stored result has no system; load\(\) gives it"):
            _ = again.system


def is_the_same(first: Result, second: Result) -> bool:
    return (
        np.array_equal(first.rows, second.rows)
        and repr(first) == repr(second)
        and first.metrics() == second.metrics()
        and dict(first.parameters) == dict(second.parameters)
        and first.events == second.events
        and str(first.system) == str(second.system)
    )


@pytest.mark.parametrize("loop", ["python", "compiled"])
def test_a_copied_result_is_the_same(tmp_path, loop):
    if loop == "compiled" and find_compiler() is None:
        pytest.skip("there is no C compiler")
    events = [{"at": 0.04, "lose": "controller.tau.r"}]
    made = simulate("fig4", stop_time=0.1, events=events, loop=loop)
    for again in (deepcopy(made), pickle.loads(pickle.dumps(made))):
        assert is_the_same(again, made)
        folders = [kept.save(tmp_path / name) for kept, name in ((made, "made"), (again, "again"))]
        for name in ("result.csv", "metrics.json"):
            first, second = ((folder / name).read_bytes() for folder in folders)
            assert first == second
        stored = read(folders[0])
        assert np.array_equal(pickle.loads(pickle.dumps(stored)).rows, made.rows)
        assert again.figure().axes


@pytest.mark.parametrize("method", ["spawn", *slow("fork", "forkserver")])
@pytest.mark.parametrize("name", ["auv.ssp", "fig4"])
def test_a_result_is_returned_by_a_pool_of_processes(native, tmp_path, name, method):
    """Also after the process that made it has ended, and removed its unpacked FMUs."""
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip(f"there is no {method} here")
    system = str(native / name) if name.endswith(".ssp") else name
    context = multiprocessing.get_context(method)
    loop = "python" if find_compiler() is None else "compiled"
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        found = pool.submit(simulate, system, stop_time=0.1, loop=loop).result()
    assert is_the_same(found, simulate(system, stop_time=0.1))
    assert np.array_equal(read(found.save(tmp_path)).rows, found.rows)
    assert np.array_equal(simulate(found.system, stop_time=0.1).rows, found.rows)


def test_a_system_brings_its_fmus_to_other_processes(native, tmp_path):
    path = tmp_path / "AuvPlant.fmu"
    shutil.copy(native / path.name, path)
    sent = pickle.dumps(load(str(path)))
    path.write_bytes(b"another")
    arrived = pickle.loads(sent)
    twice = pickle.loads(pickle.dumps(arrived))
    for system in (arrived, twice):
        rows = simulate(system, stop_time=0.1, step=0.02).rows
        assert np.array_equal(
            rows, simulate(str(native / path.name), stop_time=0.1, step=0.02).rows
        )
    assert [part.fmu.name for part in arrived.components.values()] == [path.name]


def test_a_failed_result_is_pickled_without_the_rows_that_it_lacks(failed):
    room = 8 * 5001 * (1 + len(failed.columns))
    again = pickle.loads(sent := pickle.dumps(failed))
    assert np.array_equal(again.rows, failed.rows) and len(sent) < room / 2


def test_failure_and_events_are_read_again(failed, tmp_path):
    events = [{"at": 0.04, "lose": "controller.tau.r"}, {"at": 0.08, "stop": True}]
    made = simulate("fig4", stop_time=0.2, events=events)
    again = read(made.save(tmp_path / "stopped"))
    assert len(again.events) == 2
    assert again.events == made.events
    assert read(failed.save(tmp_path / "failed")).failure == failed.failure


def test_a_changed_result_gives_a_warning(result, tmp_path):
    table = result.save(tmp_path) / "result.csv"
    table.write_text(table.read_text().replace("0.02,", "0.021,", 1))
    with pytest.warns(UserWarning, match=r"result\.csv was changed since the run wrote it"):
        read(tmp_path)
    (tmp_path / "run.json").unlink()
    with pytest.warns(UserWarning, match=r"result\.csv was changed since the run wrote it"):
        assert read_result(tmp_path).result.time[1] == 0.021
    with pytest.raises(ValueError, match="nothing: no such result"):
        read(tmp_path / "nothing")


def test_invalid_indices_are_refused(result, tmp_path):
    (result.save(tmp_path) / "metrics.json").write_text("[1]\n")
    stored = read(tmp_path)
    with pytest.raises(ValueError, match=r"metrics\.json: not the indices of a run"):
        stored.metrics()
    assert "<table></table>" in stored._repr_html_()


def test_results_are_drawn_over_each_other(result):
    other = simulate("fig4", {"planner.eta0.z": -3.0}, stop_time=0.1)
    figure = result.plot("planner.y_d", other, other)
    lines = figure.axes[0].get_lines()
    assert len(lines) == 9
    for place, run in enumerate((result, other, other)):
        for axis, line in zip("xyz", lines[3 * place :], strict=False):
            assert np.array_equal(line.get_ydata(), run[f"planner.y_d.{axis}"])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["fig4 (1)", "fig4 (2)", "fig4 (3)"]
    texts = result.plot("planner.y_d", other).legends[0].get_texts()
    assert [text.get_text() for text in texts] == ["planner.eta0.z = -2", "planner.eta0.z = -3"]


def test_figure_is_the_one_that_the_command_line_draws(result, tmp_path):
    arguments = ["run", "fig4", "--stop-time", "0.1", "--out", str(tmp_path / "written")]
    assert main(arguments) == 0
    for name, file in ((None, "fig4.svg"), ("tracking-velocity", "fig4-velocity.svg")):
        for shown in (result, read(tmp_path / "written")):
            save(shown.figure(name=name), tmp_path / "mine.svg")
            assert (tmp_path / "mine.svg").read_bytes() == (
                tmp_path / "written" / file
            ).read_bytes()
    assert result.figure()._repr_png_().startswith(b"\x89PNG")


def test_unknown_figures_are_refused(result):
    for asked, complaint in (
        ({"name": "trackin"}, "no figure 'trackin'; did you mean tracking"),
        ({"vehicle": "second"}, "no vehicle 'second'"),
    ):
        with pytest.raises(ValueError, match=complaint):
            result.figure(**asked)
    with pytest.raises(ValueError, match="'comparison': not a result; name= takes the name"):
        result.figure("comparison")


class _Page(HTMLParser):
    """The elements, texts and addresses of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []
        self.attributes: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.attributes += [name for name, _ in attrs]
        if tag != "br":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


@given(title=st.text(st.characters(codec="utf-8", exclude_characters="\r\0"), min_size=1))
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_notebook_shows_the_indices_with_all_texts_escaped(title):
    result = simulate({"title": title, "stop_time": 0.02})
    page = _Page(result._repr_html_())
    assert page.open == []
    assert set(page.attributes) <= {"style"}
    assert "".join(page.texts).startswith(f"{title}{result!r}")
    assert any(text.startswith("final error x, y, z") for text in page.texts)


def test_unknown_names_are_key_errors_with_a_suggestion(result):
    with pytest.raises(
        KeyError, match=r"no column or group 'plant\.etta'; did you mean plant\.eta"
    ):
        result["plant.etta"]
    with pytest.raises(KeyError, match="0"):
        result[0]
    with pytest.raises(KeyError, match=r"controller\.k_d"):
        result.parameters["controller.kd"]
    with pytest.raises(ValueError, match="no column matches"):
        result.plot("plant.etta")
    with pytest.raises(ValueError, match="use one of csv, parquet"):
        result.save("nowhere", format="xls")


def test_parameters_are_a_mapping_by_text(result):
    values = dict(result.parameters)
    assert values["controller.k_d"] == 50.0
    assert result.parameters[PortName("controller", "k_d")] == 50.0
    assert "controller.k_d" in result.parameters
    assert "controller.kd" not in result.parameters
    assert len(values) == len(result.parameters)


def test_repr_is_one_line_with_the_failure(result, failed):
    assert repr(result) == "<Result fig4: 6 rows of 106 columns, 0 to 0.1 s, feedthrough>"
    assert failed.failure in repr(failed)
    assert 0 < len(failed) < 5001


def test_saved_files_equal_the_files_of_the_command_line(result, tmp_path):
    saved, written = result.save(tmp_path / "saved"), tmp_path / "written"
    arguments = ["run", "fig4", "--stop-time", "0.1", "--no-figures", "--out", str(written)]
    assert main(arguments) == 0
    for name in ("result.csv", "metrics.json"):
        assert (saved / name).read_bytes() == (written / name).read_bytes()


def test_dataframe_has_the_time_as_its_index(result):
    pytest.importorskip("pandas", reason="needs the extra `docs`")
    frame = result.to_dataframe()
    assert list(frame.columns) == list(result.columns)
    assert np.array_equal(frame.index, result.time)
    assert np.array_equal(frame["plant.y.x"], result["plant.y.x"])
    frame.iloc[:] = 0.0
    assert result["plant.eta.x"][0] == 2.0


def test_dataframe_has_units_scenario_and_experiment_as_in_json(result, tmp_path):
    pytest.importorskip("pandas", reason="needs the extra `docs`")
    order = ("disturbance", "plant", "planner", "controller")
    for made in (result, simulate("fig4", stop_time=0.1, order=order)):
        attributes = made.to_dataframe().attrs
        assert json.loads(json.dumps(attributes, allow_nan=False)) == attributes
        assert (attributes["scenario"], attributes["failure"]) == ("fig4", None)
        assert attributes["experiment"]["stop_time"] == 0.1
        assert attributes["units"]["plant.tau.q"] == "N.m"


def test_units_are_as_the_fmus_state_them(result, tmp_path):
    """A stored result has them, too."""
    stated = {
        f"{name}.{variable.name}": variable.unit or ""
        for name, component in result.system.components.items()
        for variable in component.variables.values()
    }
    assert result.units == {"time": "s"} | {name: stated[name] for name in result.columns}
    assert result.units["plant.eta.psi"] == "rad" and result.units["plant.fault"] == ""
    assert read(result.save(tmp_path)).units == result.units


def test_names_in_an_editor_are_those_that_a_user_needs(result):
    assert {"metrics", "plot", "units", "keys"} <= {*dir(result)}
    assert not {"begin", "take", "end", "hold", "of"} & {*dir(result)}
    completions = result._ipython_key_completions_()
    assert {"time", "plant.eta", "plant.eta.x", "controller.theta_hat"} <= {*completions}
    assert all(name in result for name in completions)
    assert result["plant.eta"].shape == (6, 6)


# The record


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
def test_header_ending_and_loops_are_read_from_a_record_as_they_were_written(header, ending, loops):
    content = json.loads(in_json(content_of(header, ending, loops)), parse_constant=pytest.fail)
    found = header_in(content, header.columns)
    assert found == header
    # Equality ignores these, and does not distinguish 1, 1.0 and True.
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
def test_invalid_records_are_refused_by_name(folder, change):
    file = folder / "run.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    with pytest.raises(InputError, match=r"run\.json"):
        read_record(folder / "result.csv")


@pytest.mark.parametrize("text", ["time,a.x\n", "time,a.x\n0,1\n0,2\n", "time,a.x\n1,1\n0,2\n"])
def test_rows_without_a_step_are_refused(tmp_path, text):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputError, match=r"t\.csv"):
        read_result(tmp_path / "t.csv")


def test_duration_does_not_depend_on_the_clock(monkeypatch):
    monkeypatch.setattr("orchestrator.runs.result.monotonic", iter([5.0, 7.25]).__next__)
    times = Stopwatch().times()
    assert times["seconds"] == 2.25
    assert datetime.fromisoformat(str(times["started"])).utcoffset() is not None


def test_a_run_lasts_as_long_however_late_it_is_saved(monkeypatch):
    monkeypatch.setattr("orchestrator.runs.result.monotonic", iter([5.0, 7.25]).__next__)
    clock = Stopwatch()
    clock.stop()
    assert [pickle.loads(pickle.dumps(clock)).times()["seconds"] for _ in range(2)] == [2.25, 2.25]
