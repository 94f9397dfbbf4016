"""`auv-fmu plot`, `view` and `animate` as a user types them, and the page in a browser."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from shutil import which

import pytest

from orchestrator.commands.main import main
from orchestrator.runs.record import read_result
from support.machine import contents

BROWSER = which("chromium") or which("chromium-browser") or which("google-chrome")


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
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-logging=stderr",
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
