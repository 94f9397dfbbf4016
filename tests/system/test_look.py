"""`auv-fmu plot` and `animate` as a user types them."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestrator.commands.main import main
from orchestrator.runs.result import read_result
from support.machine import contents


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two short results."""
    folder = tmp_path_factory.mktemp("results")
    for name, std in (("noisy", "0.001"), ("quiet", "0")):
        out = str(folder / name)
        arguments = ["run", "fig4", "--stop-time", "1", "--set", f"plant.noise.std={std}"]
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
        assert f">{label}</text>" in text


def test_record_that_does_not_name_a_table_is_not_its_record(results, tmp_path):
    """Parameters of another table next to the record are unknown."""
    for name in ("result.csv", "other.csv"):
        (tmp_path / name).write_bytes((results / "quiet" / "result.csv").read_bytes())
    (tmp_path / "run.json").write_bytes((results / "quiet" / "run.json").read_bytes())
    assert read_result(tmp_path)[1].parameters
    name, table, *_ = read_result(tmp_path / "other.csv")
    assert name == "other"
    assert not table.parameters


def test_animation_is_written_with_step_and_order(tmp_path):
    """One film shows all vehicles."""
    scenario, film = tmp_path / "three.toml", tmp_path / "films" / "three.gif"
    scenario.write_text("vehicles = 3\nstop_time = 1.0\n", encoding="utf-8")
    options = ["--step", "0.01", "--order", "jacobi", "--fps", "1", "--size", "300x200"]
    assert main(["animate", str(scenario), *options, "--out", str(film)]) == 0
    assert film.read_bytes().startswith(b"GIF89a")
    assert contents(film.parent).keys() == {"three.gif"}
