"""`auv-fmu plot`, `view` and `animate` as a user types them, and the page in a browser."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

from orchestrator.commands.main import main
from orchestrator.runs.result import read_result
from support.browser import BROWSER, browser
from support.machine import contents

#: A scene is drawn without a graphics card.
SOFTWARE = "--use-angle=swiftshader", "--enable-unsafe-swiftshader"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two short results."""
    folder = tmp_path_factory.mktemp("results")
    for name, std in (("noisy", "0.001"), ("quiet", "0")):
        out = str(folder / name)
        arguments = ["run", "fig4", "--stop-time", "4", "--set", f"plant.noise.std={std}"]
        assert main([*arguments, "--no-figures", "--out", out]) == 0
    return folder


def test_plot_draws_results_over_each_other(results, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    both = [str(results / "noisy"), str(results / "quiet" / "result.csv")]
    assert main(["plot", *both, "plant.y.*"]) == 0
    assert capsys.readouterr().out == "plot.png\n"
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
    assert main(["plot", *both, "plant.nu", "--out", "below/nu.svg"]) == 0
    text = (tmp_path / "below" / "nu.svg").read_text()
    for label in ("plant.noise.std = 0.001", "plant.noise.std = 0"):
        assert f"<!-- {label} -->" in text


def test_record_that_does_not_name_a_table_is_not_its_record(results, tmp_path):
    """Another table beside the record: nothing is known of its parameters."""
    for name in ("result.csv", "other.csv"):
        (tmp_path / name).write_bytes((results / "quiet" / "result.csv").read_bytes())
    (tmp_path / "run.json").write_bytes((results / "quiet" / "run.json").read_bytes())
    assert read_result(tmp_path)[1].parameters
    name, table, *_ = read_result(tmp_path / "other.csv")
    assert name == "other"
    assert not table.parameters


def test_parameter_of_a_wrong_kind_is_told(results, tmp_path, capsys):
    pytest.importorskip("plotly", reason="needs the extra `view`")
    (tmp_path / "result.csv").write_bytes((results / "quiet" / "result.csv").read_bytes())
    record = json.loads((results / "quiet" / "run.json").read_text())
    record["parameters"]["plant.ell"] = "long"
    (tmp_path / "run.json").write_text(json.dumps(record))
    assert main(["view", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "plant.ell is 'long'" in error
    assert error.count("\n") == 1


def test_animation_is_written_with_step_and_order(tmp_path):
    out = tmp_path / "films" / "fig4.gif"
    arguments = ["animate", "fig4", "--stop-time", "1", "--step", "0.01", "--order", "jacobi"]
    assert main([*arguments, "--fps", "2", "--out", str(out)]) == 0
    assert out.read_bytes().startswith(b"GIF89a")
    assert contents(out.parent).keys() == {"fig4.gif"}


def test_view_stands_by_itself_and_is_light(results, capsys):
    pytest.importorskip("plotly", reason="needs the extra `view`")
    capsys.readouterr()
    assert main(["view", str(results / "noisy")]) == 0
    page = results / "noisy" / "view.html"
    assert capsys.readouterr().out == f"{page}\n"
    text = page.read_text(encoding="utf-8")
    assert len(text) < 8e6
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text)
    assert re.search(r'Content-Security-Policy" content="default-src .none.;', text)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scenario of three vehicles, and its result."""
    folder = tmp_path_factory.mktemp("fleet")
    scenario = folder / "three.toml"
    scenario.write_text(
        "vehicles = 3\nstop_time = 1.0\n[parameters]\n"
        '"auv*.plant.eta0.y" = { first = 6.0, step = 4.0 }\n',
        encoding="utf-8",
    )
    arguments = ["run", str(scenario), "--no-figures", "--out", str(folder / "result")]
    assert main(arguments) == 0
    return folder


def test_vehicles_of_a_run_are_on_one_page_and_in_one_film(fleet, tmp_path):
    pytest.importorskip("plotly", reason="needs the extra `view`")
    page = tmp_path / "page" / "three.html"
    assert main(["view", str(fleet / "result"), "--out", str(page)]) == 0
    film = tmp_path / "film" / "three.gif"
    assert main(["animate", str(fleet / "three.toml"), "--fps", "1", "--out", str(film)]) == 0
    assert contents(tmp_path / "page").keys() == {"three.html"}
    assert contents(tmp_path / "film").keys() == {"three.gif"}
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"<option[^>]*>(auv\d)</option>", text) == ["auv1", "auv2", "auv3"]
    assert len(text) < 8e6


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed")
def test_a_vehicle_is_chosen_in_a_browser(fleet, tmp_path):
    """Its panels take the place of the first vehicle's, at the time that is shown."""
    pytest.importorskip("plotly", reason="needs the extra `view`")
    page = tmp_path / "three.html"
    assert main(["view", str(fleet / "result"), "--out", str(page)]) == 0
    with browser(tmp_path / "profile", *SOFTWARE) as chromium:
        chromium.open(page)
        chromium.evaluate(
            "new Promise(done => { (function wait() {"
            " series.layout && scene._fullLayout ? done() : setTimeout(wait, 50); })(); })"
        )
        titles = "series.layout.annotations.map(one => one.text)"
        assert chromium.evaluate(titles)[2].startswith("auv1: tracking errors")
        before = chromium.evaluate("series.data.length")
        chromium.evaluate("show(30); vehicle.value = 1; vehicle.onchange()")
        after = chromium.evaluate(titles)
        assert len(after) > 2 and all(text.startswith("auv2: ") for text in after[2:])
        assert chromium.evaluate("series.data.length") == before
        # The cursor, and the three trails up to there.
        [time, cursor] = chromium.evaluate("[times[30], series.layout.shapes[0].x0]")
        assert cursor == time > 0.0
        points = "data.moving.slice(0, 6).map(k => scene.data[k].x.length)"
        assert chromium.evaluate(points)[::2] == [31, 31, 31]
        assert not chromium.said


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed")
def test_view_plays_in_a_browser(results, tmp_path):
    """Opened with #play, time moves on; nothing is said on the console."""
    pytest.importorskip("plotly", reason="needs the extra `view`")
    page = tmp_path / "view.html"
    assert main(["view", str(results / "noisy"), "--out", str(page)]) == 0
    process = subprocess.run(
        [
            str(BROWSER), "--headless", "--no-sandbox", f"--user-data-dir={tmp_path / 'profile'}",
            *SOFTWARE, "--enable-logging=stderr",
            "--timeout=8000", "--dump-dom", f"{page.as_uri()}#play",
        ],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    said = [line for line in process.stderr.splitlines() if ":CONSOLE" in line]
    assert not [line for line in said if "ERROR" in line or "Uncaught" in line], said
    body = process.stdout[process.stdout.index("<body") :]
    assert body.count("<canvas") >= 1
    assert 'class="cartesianlayer"' in body
    [shown] = re.findall(r'<output id="time">([0-9.]+) s', body)
    assert float(shown) > 0.0
