"""A run that begins at another time has the same rows, except for their times, in every command.

Times are multiples of 1/64 s, which doubles hold exactly, so everything else is equal bit for bit.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import (
    Ending,
    Experiment,
    Header,
    Isolation,
    Selection,
    System,
    Table,
    Value,
    write_ssp,
)
from orchestrator.figures.drawing import compose, plot
from orchestrator.figures.run_figures import FIGURES
from orchestrator.runs.result import read_result
from orchestrator.runs.wiring import closed_loop
from orchestrator.studies.store import StudyResult
from support import linear, relay, typed
from support.live import needs_npm
from support.pages import stored
from support.runs import run_table
from support.texts import mentions
from support.tiers import slow

#: Systems, and when each begins [s].
STARTS = {"vehicle": 30.0, "relays": -1.0, "typed": 30.0, "linear": -1.0}
each_system = pytest.mark.parametrize(("name", "start"), STARTS.items())
STEP, LENGTH, INTERVAL = 1 / 64, 4.0, 0.25

#: An output and an input that nothing feeds of each system, and a parameter.
SIGNALS = {
    "vehicle": ("plant.nu.u", "plant.water.x", "plant.m11"),
    "relays": ("b.y", "a.u", "a.c"),
    "typed": ("b.w[1]", "a.v[1]", "a.counts_from"),
    "linear": ("first.y0", "first.u1", "first.x0"),
}

#: Columns that are times themselves.
TIMES = {"a.t", "b.t"}


@pytest.fixture(scope="module")
def systems(native: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, System]:
    """Autonomous systems: the vehicle's oscillating disturbance is turned off."""
    folder = tmp_path_factory.mktemp("fmus")
    of_relays = {"a": relay.relay(folder), "b": relay.relay(folder)}
    types = {f"b.u_{kind}": f"a.y_{kind}" for kind in typed.SCALARS}
    values: dict[str, Value] = {f"a.u_{kind}": value for kind, value in typed.VALUES.items()}
    values |= {f"{name}.{end}_at": 1e300 for name in "ab" for end in ("end", "early")}
    masses = linear.TWO_MASSES
    fmus = {name: linear.linear(folder) for name in masses.parts}
    return {
        "vehicle": closed_loop(native).with_parameters({"disturbance.A_d": 0.0}),
        "relays": relay.system_of(of_relays, {"b.u": "a.y"}, {"a.c": 1.0, "b.a": 2.0}),
        "typed": typed.system_of(typed.build(folder), "ab", types, values),
        "linear": linear.system_of(fmus, masses.parts, masses.wires),
    }


def same(table: Table, other: Table, start: float) -> bool:
    """True if a run equals another one that begins at 0."""
    times = [0, *(table.header.place[name] for name in TIMES & {*table.columns})]
    rows = table.rows.copy()
    rows[:, times] -= start
    strings = [name for name, type_ in table.header.types.items() if type_ == "String"]
    return (
        rows.tobytes() == other.rows.tobytes()
        and all(list(table[name]) == list(other[name]) for name in strings)
        and table.ending.failure == other.ending.failure
        and [event._replace(time=event.time - start) for event in table.ending.events]
        == [*other.ending.events]
    )


@each_system
@pytest.mark.parametrize("loop", ["python", "compiled", *slow("isolated")])
def test_every_loop_makes_the_same_rows(systems, name, start, loop):
    def made(start: float) -> Table:
        experiment = Experiment(start + LENGTH, STEP, start_time=start)
        if loop == "isolated":
            return run_table(systems[name], experiment, isolation=Isolation())
        return run_table(systems[name], experiment, loop)

    assert same(made(start), made(0.0), start)


@settings(max_examples=15)
@given(
    start=st.integers(-200, 2000).map(lambda k: k / 8),
    step=st.sampled_from([1 / 64, 1 / 16, 3 / 32]),
    length=st.integers(1, 60).map(lambda k: k / 16),
    interval=st.integers(1, 40).map(lambda k: k / 16),
    at=st.integers(0, 60).map(lambda k: k / 16),
    lasts=st.integers(1, 30).map(lambda k: k / 16),
    times=st.lists(st.integers(-10, 60), min_size=1, max_size=4).map(sorted),
    decimated=st.booleans(),
)
def test_events_inputs_and_intervals_move_with_the_start(
    systems, tmp_path_factory, start, step, length, interval, at, lasts, times, decimated
):
    """Events, a table of inputs, intervals of rows, longer steps of a component."""
    table = tmp_path_factory.mktemp("inputs") / "inputs.csv"

    def made(start: float) -> Table:
        lines = [f"{start + time / 16!r},{k}" for k, time in enumerate(times)]
        table.write_text("\n".join(["time,a.u", *lines, ""]))
        system = replace(systems["relays"], start_time=start)
        result = simulate(
            system,
            stop_time=start + length,
            step=step,
            events=[
                {"at": start + at, "override": {"a.y": 5.0}, "for": lasts},
                {"when": "b.y > 1.5", "bias": {"a.y": -2.0}, "for": lasts, "repeat": True},
            ],
            inputs=table,
            steps={"b": 2 * step} if decimated else {},
        )
        selected = Table()
        selection = Selection(selected, interval)
        selection.begin(result.header)
        selection.take(result.rows)
        selection.end(result.ending)
        return selected

    assert same(made(start), made(0.0), start)


@given(
    start=st.floats(-1e6, 2e9),
    step=st.floats(1e-3, 10.0),
    every=st.integers(1, 50),
    rows=st.integers(1, 300),
)
def test_one_row_is_kept_for_each_interval_from_any_start(start, step, every, rows):
    experiment = Experiment(start + rows * step, step, start_time=start)
    times = np.array([experiment.time(k) for k in range(rows)])
    kept = Table()
    selection = Selection(kept, every * step)
    selection.begin(Header((), experiment))
    selection.take(times[:, np.newaxis])
    selection.end(Ending())
    assert kept.time.tolist() == times[sorted({*range(0, rows, every), rows - 1})].tolist()


def test_a_run_that_an_fmu_ends_within_a_step_ends_at_the_same_place(systems):
    def made(start: float) -> Table:
        system = systems["typed"].with_parameters({"a.end_at": start + 2.25})
        return run_table(system, Experiment(start + LENGTH, 0.5, start_time=start))

    first = made(0.0)
    assert first.time[-1] == 2.0
    assert same(made(30.0), first, 30.0)


# Commands


@pytest.fixture(scope="module")
def folders(systems, tmp_path_factory) -> Callable[[str, float], Path]:
    """A folder for each system and start: `x.ssp`, events, inputs, and a result in `run`."""
    made: dict[tuple[str, float], Path] = {}

    def folder(name: str, start: float) -> Path:
        if (name, start) in made:
            return made[name, start]
        place = made[name, start] = tmp_path_factory.mktemp(name)
        output, given, _ = SIGNALS[name]
        stop = start + 4.0
        system = replace(systems[name], name="x", start_time=start, stop_time=stop, step=STEP)
        write_ssp(system, place)
        (place / "events.toml").write_text(
            f'[[events]]\nat = {start + 1.0}\nfreeze = "{SHAKEN[name]}"\nfor = 0.5\n'
            f'[[events]]\nat = {start + 2.0}\noverride."{SHAKEN[name]}" = 0.25\nfor = 0.25\n'
        )
        (place / "inputs.csv").write_text(
            f"time,{given}\n{start - 1.0},0\n{start + 3.0},0.125\n{start + 9.0},0.0625\n"
        )
        options = ["--events", str(place / "events.toml"), "--inputs", str(place / "inputs.csv")]
        options += ["--interval", str(INTERVAL), "--no-figures", "--out", str(place / "run")]
        assert main(["run", str(place / "x.ssp"), *options]) == 0
        return place

    return folder


#: A signal of each system that feeds something, which events act on.
SHAKEN = {
    "vehicle": "plant.y.x", "relays": "a.y", "typed": "a.y_Float64", "linear": "first.y0",
}  # fmt: skip


def cells(path: Path, start: float) -> list[list[str]]:
    """A table as text, with the times of a run that begins at 0."""
    with path.open(newline="") as lines:
        names, *rows = csv.reader(lines)
    times = {names.index(name) for name in ("time", *TIMES) if name in names}
    return [names] + [
        [str(float(cell) - start) if i in times else cell for i, cell in enumerate(row)]
        for row in rows
    ]


@each_system
def test_files_of_a_run_differ_only_in_their_times(folders, name, start):
    late, early = folders(name, start) / "run", folders(name, 0.0) / "run"
    for file in ["result.csv", *["certificates.csv"] * (name == "vehicle")]:
        rows = cells(late / file, start)
        assert rows == cells(early / file, 0.0)
        assert float(rows[1][0]) == 0.0 and float(rows[2][0]) == INTERVAL
    metrics, expected = (json.loads((path / "metrics.json").read_text()) for path in (late, early))
    assert metrics.pop("stop_time") - start == expected.pop("stop_time")
    assert metrics == expected
    record, first = (json.loads((path / "run.json").read_text()) for path in (late, early))
    assert [{**event, "time": event["time"] - start} for event in record["events"]] == first[
        "events"
    ]
    assert len(first["events"]) == 4
    assert record["experiment"]["start_time"] == start


@each_system
def test_commands_take_the_system_and_the_result(folders, name, start, capsys, tmp_path):
    """`check`, `verify`, `export`, `plot`, and `run` with checkpoints."""
    output, *_ = SIGNALS[name]
    outputs = []
    for time in (start, 0.0):
        folder = folders(name, time)
        ssp, result = str(folder / "x.ssp"), str(folder / "plain")
        capsys.readouterr()
        assert main(["check", ssp]) == 0
        assert main(["run", ssp, "--no-figures", "--out", result]) == 0
        table = f"{result}/result.csv"
        assert main(["verify", table, "--scenario", ssp]) == 0
        # Among the outputs are times.
        shift = re.sub(
            r"t = \S+ to \S+ s|t = \S+,|^  \S+ .*", "", capsys.readouterr().out, flags=re.M
        )
        outputs.append(shift.replace(str(folder), ""))
        whole = Path(table).read_text()
        if name in ("vehicle", "linear"):
            # The others cannot save their states.
            options = ["--no-figures", "--checkpoint-every", "1", "--out", result]
            assert main(["run", ssp, *options]) == 0
            assert Path(table).read_text() == whole
        assert main(["plot", result, output, "--out", str(tmp_path / f"{time:g}.svg")]) == 0
        assert main(["export", ssp, "--out", str(tmp_path / f"{time:g}")]) == 0
        assert load(tmp_path / f"{time:g}" / "x.ssp").start_time == time
    assert outputs[0] == outputs[1]


def test_a_table_that_begins_before_the_run_does_not_belong_to_it(folders, refused):
    folder = folders("vehicle", 30.0)
    table = folders("vehicle", 0.0) / "run" / "result.csv"
    line = refused("verify", str(table), "--scenario", str(folder / "x.ssp"))
    assert mentions(line, "before 30 s")


@pytest.mark.parametrize("name", ["relays", *slow("vehicle")])
def test_a_study_has_the_same_numbers(folders, name, tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    tables = []
    for time in (STARTS[name], 0.0):
        *_, parameter = SIGNALS[name]
        study = tmp_path / f"{time:g}.toml"
        study.write_text(
            f'scenario = "{folders(name, time) / "x.ssp"}"\n'
            f'stop_time = {{ base = {time}, per = {{ "{parameter}" = 0.125 }} }}\n'
            f'[vary]\n"{parameter}" = [4.0, 8.0, 16.0]\n'
        )
        assert main(["check", str(study)]) == 0
        out = tmp_path / f"{time:g}"
        assert main(["sweep", str(study), "--workers", "1", "--out", str(out)]) == 0
        tables.append(StudyResult(out))
    first, second = tables
    assert list(first) == list(second) and first.failed == second.failed == 0
    for column in first:
        assert str(first[column].tolist()) == str(second[column].tolist())
    assert name == "relays" or np.isfinite(first["rms_effort.u"]).all()


def test_figures_show_the_same_at_other_times(folders):
    """The axes of time are moved; all other axes follow the data, which are equal."""

    def drawn(start: float) -> list[Any]:
        run = read_result(folders("vehicle", start) / "run")
        rows = [compose("", rows, [run])[0] for rows in FIGURES["tracking"].values()]
        return [axes for figure in [*rows, plot([run])] if figure for axes in figure.axes]

    start = STARTS["vehicle"]
    panels, expected = drawn(start), drawn(0.0)
    assert len(panels) == len(expected) > 10
    for panel, twin in zip(panels, expected, strict=True):
        moved = start if panel.get_xlim()[0] == start else 0.0
        assert np.subtract(panel.get_xlim(), moved) == pytest.approx(twin.get_xlim())
        assert panel.get_ylim() == pytest.approx(twin.get_ylim())
    assert sum(axes.get_xlim()[0] == start for axes in panels) > 5


@needs_npm
@pytest.mark.usefixtures("script")
def test_pages_show_the_same_at_other_times(folders, tmp_path):
    start = STARTS["vehicle"]

    def page(start: float) -> tuple[Any, dict[str, Any]]:
        out = tmp_path / f"{start:g}.html"
        assert main(["view", str(folders("vehicle", start) / "run"), "--out", str(out)]) == 0
        data, [columns] = stored(out.read_text(encoding="utf-8"))
        return data, columns

    (late, columns), (early, before) = page(start), page(0.0)
    assert (columns.pop("time") - start).tolist() == before.pop("time").tolist()
    assert {name: values.tolist() for name, values in columns.items()} == {
        name: values.tolist() for name, values in before.items()
    }
    times = [[event["time"] for event in data["loops"][0]["happened"]] for data in (late, early)]
    assert times[0] == [time + start for time in times[1]]


def test_a_film_begins_with_the_run(folders, tmp_path):
    from PIL import Image  # noqa: PLC0415

    out = tmp_path / "film.gif"
    ssp = str(folders("vehicle", STARTS["vehicle"]) / "x.ssp")
    assert main(["animate", ssp, "--fps", "1", "--size", "300x200", "--out", str(out)]) == 0
    with Image.open(out) as film:
        assert film.n_frames == 10


def test_a_live_page_begins_at_0_only(folders, refused):
    assert refused("live", str(folders("vehicle", STARTS["vehicle"]) / "x.ssp"))
