"""The page of `auv-fmu view` contains only the runs, and shows them in a browser."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.commands.main import main
from orchestrator.cosim import Ending, Header, Occurrence, PortName, Table
from orchestrator.figures.style import Drawn
from orchestrator.live.view import Stored, view_page
from orchestrator.runs.result import read_result
from orchestrator.vehicle.signals import STANDARD
from support.browser import BROWSER, Browser, browser
from support.live import needs_npm
from support.pages import stored
from support.tables import fleet, fleet_table, loop_table, table_of

pytestmark = [needs_npm, pytest.mark.usefixtures("script")]

#: A scene is drawn without a graphics card.
SOFTWARE = "--use-angle=swiftshader", "--enable-unsafe-swiftshader"


def page_of(*runs: Drawn, metrics: dict[str, Any] | None = None, title: str = "run") -> str:
    return view_page(title, [Stored(run, metrics or {}) for run in runs])


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_rows_equal_the_run(offset):
    """All times exactly, and other columns within single precision of their changes."""
    table = loop_table()
    table["plant.eta.x"][:] += offset
    _, [columns] = stored(page_of(Drawn("run", table)))
    assert columns["time"].tolist() == table.time.tolist()
    assert columns.keys() - {"time"} == {*table.columns} - {*STANDARD.nu}
    for name, values in columns.items():
        exact = offset and name == "plant.eta.x"
        np.testing.assert_allclose(values, table[name], rtol=0.0 if exact else 1e-7, atol=1e-9)


def test_longer_runs_have_fewer_rows_and_both_ends():
    time = np.linspace(0.0, 1.0, 100_001)
    table = table_of(time, **{f"a__x{k}": time**k for k in range(16)})
    _, [columns] = stored(page_of(Drawn("run", table)))
    assert len(columns["time"]) == 25_000
    assert columns["time"][[0, -1]].tolist() == [0.0, 1.0]
    np.testing.assert_allclose(columns["a.x2"], columns["time"] ** 2, rtol=1e-6)


def test_a_page_of_many_vehicles_is_light():
    two, twenty = (
        len(page_of(Drawn("run", fleet_table(n, 5000), loops=fleet(n)))) for n in (2, 20)
    )
    assert twenty < 4 * two


@pytest.mark.parametrize("ended", [100, 400])
def test_compared_runs_have_the_same_times(ended):
    """Also if one has fewer rows and ends earlier."""
    table = loop_table()
    other = Table.of(table.header, table.rows[:ended:2])
    data, [one, two] = stored(page_of(Drawn("one", table), Drawn("two", other)))
    assert [loop["label"] for loop in data["loops"]] == ["one", "two"]
    n = len(two["time"])
    assert n == ended - 1
    assert two["time"].tolist() == one["time"][:n].tolist()
    np.testing.assert_allclose(two["plant.tau.u"], other["plant.tau.u"][np.arange(n) // 2])


def test_a_comparison_with_another_number_of_vehicles_is_left_out():
    run, other = Drawn("one", loop_table()), Drawn("two", fleet_table(2), loops=fleet(2))
    assert [loop["label"] for loop in stored(page_of(run, other))[0]["loops"]] == ["one"]


def test_events_have_the_numbers_of_the_record():
    table = loop_table()
    events = [Occurrence(1.0, "a", "gust", 3), Occurrence(2.0, "a, ended", event=3)]
    ending = Ending(failure="refused", remark="over", events=tuple(events))
    page = page_of(Drawn("run", Table.of(table.header, table.rows, ending)))
    [loop] = stored(page)[0]["loops"]
    assert [Occurrence(**event) for event in loop["happened"]] == events
    assert "refused. over." in page


def test_indices_equal_the_result():
    metrics = {"final_error": [1.0, float("inf"), "x"], "parameters": {}, "scenario": "mine"}
    [loop] = stored(page_of(Drawn("run", loop_table()), metrics=metrics))[0]["loops"]
    assert loop["metrics"] == [{"final_error": [1.0, None, None]}]
    each = {"vehicles": {"auv2": {"final_error": [2.0]}}, "smallest_distance": 3.0}
    run = Drawn("run", fleet_table(2), loops=fleet(2))
    [loop] = stored(page_of(run, metrics=each))[0]["loops"]
    together = {"smallest_distance": [3.0]}
    assert loop["metrics"] == [together, {"final_error": [2.0], **together}]


def test_missing_columns_are_named_on_the_page():
    text = page_of(Drawn("run", loop_table(without=STANDARD.theta_hat)))
    assert "estimated parameters left out: the run has no controller.theta_hat[1]" in text
    loops = fleet(3)
    text = page_of(Drawn("run", fleet_table(3, without=loops[2].posture), loops=loops))
    assert "auv3: path left out: the run has no auv3.plant.eta.x" in text
    [loop] = stored(text)[0]["loops"]
    assert [vehicle["name"] for vehicle in loop["vehicles"]] == ["auv1", "auv2"]


def test_a_run_without_a_vehicle_has_a_chart_for_each_column():
    table = loop_table(without=STANDARD.posture)
    table["plant.tau.u"][10:20] = [np.nan, np.inf] * 5
    data, [columns] = stored(page_of(Drawn("run", table)))
    # Values that are not finite are gaps.
    assert np.isnan(columns["plant.tau.u"]).nonzero()[0].tolist() == [*range(10, 20)]
    assert data["columns"].keys() == {*table.columns}
    assert data["columns"]["plant.tau.u"] == "N"
    assert columns.keys() == {"time", *table.columns}


def test_titles_and_names_are_text_and_no_markup():
    run = Drawn("run", fleet_table(3), loops=fleet(3))
    loops = [replace(loop, vehicle=f"<i>.{loop.vehicle}") for loop in run.loops]
    columns = [f"<i>.{name}" if ".plant." in name else name for name in run.result.columns]
    parameters = {
        PortName.read(f"<i>.{name}"): value for name, value in run.result.parameters.items()
    }
    header = Header(tuple(columns), run.result.header.experiment, parameters)
    table = Table.of(header, run.result.rows)
    text = page_of(Drawn("run", table, loops=loops), title="<script>alert(1)</script> {{data}}")
    assert "<script>alert(1)" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; {{data}}" in text
    assert stored(text)[0]["loops"][0]["vehicles"][0]["name"] == "<i>.auv1"


# On the command line


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results: of a comparison with an event, of three vehicles, and of a single planner."""
    folder = tmp_path_factory.mktemp("results")
    scenarios = {
        "both": 'label = "<b>"\nstop_time = 4.0\n'
        '[compare]\nname = "fig5-pd"\nlabel = "PD"\ncomponents.controller = "PdController"\n'
        'wires."controller.dy" = "plant.dy"\n[[events]]\nat = 1.0\nfor = 2.0\n'
        'lose = "controller.tau.r"\nlabel = "no yaw"\n',
        "three": "vehicles = 3\nstop_time = 4.0\n[parameters]\n"
        '"auv*.plant.eta0.y" = { first = 6.0, step = 4.0 }\n',
        "alone": 'only = ["planner"]\nstop_time = 4.0\n',
    }
    for name, text in scenarios.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        arguments = ["run", str(folder / f"{name}.toml"), "--no-figures"]
        assert main([*arguments, "--out", str(folder / name)]) == 0
    return folder


def view(result: Path, out: Path) -> str:
    assert main(["view", str(result), "--out", str(out)]) == 0
    return out.read_text(encoding="utf-8")


def test_page_stands_by_itself_and_is_light(results, capsys):
    capsys.readouterr()
    assert main(["view", str(results / "both")]) == 0
    page = results / "both" / "view.html"
    assert capsys.readouterr().out == f"{page}\n"
    text = page.read_text(encoding="utf-8")
    assert len(text) < 400_000
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text)
    [policy] = re.findall(r'Content-Security-Policy" content="(.+?)"', text)
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    assert "ogl" in text and "uplot" in text and "MIT License" in text


def test_result_is_beside_the_one_that_it_is_compared_with(results, tmp_path):
    data, runs = stored(view(results / "both", tmp_path / "page.html"))
    assert [loop["label"] for loop in data["loops"]] == ["<b>", "PD"]
    for columns, folder in zip(runs, ("", "fig5-pd"), strict=True):
        table = read_result(results / "both" / folder).result
        np.testing.assert_allclose(columns["plant.eta.z"], table["plant.eta.z"], rtol=1e-6)
    data, _ = stored(view(results / "both" / "fig5-pd", tmp_path / "pd.html"))
    assert [loop["label"] for loop in data["loops"]] == ["PD"]


def test_parameter_of_a_wrong_kind_is_told(results, tmp_path, capsys):
    for name in ("result.csv", "run.json"):
        (tmp_path / name).write_bytes((results / "both" / "fig5-pd" / name).read_bytes())
    record = json.loads((tmp_path / "run.json").read_text())
    record["parameters"]["plant.ell"] = "long"
    (tmp_path / "run.json").write_text(json.dumps(record))
    assert main(["view", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "plant.ell is 'long'" in error
    assert error.count("\n") == 1


# In a browser


in_browser = pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed")


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory):
    with browser(tmp_path_factory.mktemp("profile"), *SOFTWARE) as found:
        yield found


def opened(chromium: Browser, page: Path) -> Browser:
    """Open a page, and wait until it has drawn its runs."""
    chromium.open(page)
    end = time.monotonic() + 60.0
    while not chromium.evaluate("document.body.classList.contains('started')"):
        assert time.monotonic() < end, chromium.said
        time.sleep(0.05)
    return chromium


CHARTS = (
    "[...document.querySelectorAll('.chart')].filter(one => one.offsetParent)"
    ".map(one => one.querySelector('.name').innerText)"
)


@in_browser
@pytest.mark.slow
def test_comparison_is_played_with_its_events(results, tmp_path, chromium):
    view(results / "both", tmp_path / "page.html")
    shown = opened(chromium, tmp_path / "page.html").evaluate
    legend = "document.getElementById('legend').innerText.split('\\n')"
    assert shown(legend) == ["<b>", "PD", "reference"]
    mark = "document.querySelector('#marks span')"
    assert shown(f"[{mark}.title, {mark}.style.left, {mark}.style.width]") == [
        "no yaw, at 1 s", "25%", "50%",
    ]  # fmt: skip
    table = "document.getElementById('indices').innerText"
    assert "PD" in shown(table)
    shown("document.querySelector('#loops input[value=PD]').click()")
    assert "PD" not in shown(table)
    now = "parseFloat(document.getElementById('now').textContent)"
    end = time.monotonic() + 60.0
    while not shown(now) > 0.0:
        assert time.monotonic() < end
    shown("document.getElementById('play').click()")
    assert 0.0 < shown(now) < 4.0
    assert not chromium.said
    assert [address.split(":")[0] for address in chromium.requests] == ["file"]


@in_browser
@pytest.mark.slow
def test_a_run_rests_at_its_end_for_those_who_want_no_motion(results, tmp_path, chromium):
    view(results / "both", tmp_path / "page.html")
    still = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    chromium.call("Emulation.setEmulatedMedia", features=still)
    shown = opened(chromium, tmp_path / "page.html").evaluate
    assert shown("document.getElementById('now').textContent") == "4.00 s"
    chromium.call("Emulation.setEmulatedMedia", features=[])


@in_browser
@pytest.mark.slow
def test_a_vehicle_is_chosen(results, tmp_path, chromium):
    view(results / "three", tmp_path / "page.html")
    shown = opened(chromium, tmp_path / "page.html").evaluate
    select = "document.getElementById('vehicle')"
    assert shown(f"[...{select}.options].map(one => one.value)") == ["auv1", "auv2", "auv3"]
    table = "document.getElementById('indices').innerText"
    before = shown(table)
    shown(f"{select}.value = 'auv2'; {select}.dispatchEvent(new Event('change'))")
    assert shown(table) != before
    assert "distance [m]" in shown(CHARTS)
    assert not chromium.said


@in_browser
@pytest.mark.slow
def test_without_a_vehicle_there_are_only_charts(results, tmp_path, chromium):
    view(results / "alone", tmp_path / "page.html")
    shown = opened(chromium, tmp_path / "page.html").evaluate
    assert shown("document.getElementById('stage').hidden")
    assert shown(CHARTS)[:3] == ["x [m]", "y [m]", "z [m]"]
    assert shown("document.querySelector('.series h2').innerText").startswith("planner.y_d")
    assert not chromium.said
