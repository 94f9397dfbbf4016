"""`simulate`, `load` and `Result`, as a picky user tries them."""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np
import pytest

import orchestrator
from orchestrator import Result, load, simulate
from orchestrator.commands.main import main
from orchestrator.system.names import PortName


@pytest.fixture(scope="module")
def result() -> Result:
    return simulate("fig4", stop_time=0.1)


def test_package_shows_its_four_names():
    assert (
        set(orchestrator.__all__)
        == {"Result", "load", "simulate", "sweep"}
        <= set(dir(orchestrator))
    )
    assert not hasattr(orchestrator, "nothing")


def test_help_explains_every_argument():
    text = inspect.getdoc(simulate) or ""
    for name in inspect.signature(simulate).parameters:
        assert f"{name}:" in text


@pytest.mark.parametrize(
    ("name", "value", "taken"),
    [
        ("controller.k_d", 40, 40.0),
        ("controller.k_d", np.int64(40), 40.0),
        ("controller.k_d", np.float32(40.0), 40.0),
        ("controller.k_d", "4e1", 40.0),
        ("plant.noise.seed", np.int64(7), 7),
        ("controller.printed_jacobian", True, True),
        ("controller.printed_jacobian", np.True_, True),
        ("controller.saturation", "algebraic", "algebraic"),
    ],
)
def test_values_are_taken_as_they_come(name, value, taken):
    result = simulate("fig4", {name: value}, stop_time=0.02)
    assert result.parameters[name] == taken
    assert result.metrics()["parameters"] == {name: taken}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("controller.kd", 40.0),
        ("controler.k_d", 40.0),
        ("k_d", 40.0),
        ("controller.K1", 12.0),
        ("controller.k_d", -1.0),
        ("controller.k_d", "many"),
        ("controller.k_d", "nan"),
        ("plant.noise.seed", "4.5"),
        ("controller.saturation", "none"),
        ("controller.y.x", 1.0),
        ("controller.tau.u", 1.0),
    ],
)
def test_mistakes_are_told_in_the_words_of_the_command_line(name, value, tmp_path, capsys):
    out = str(tmp_path / "out")
    assert main(["run", "fig4", "--set", f"{name}={value}", "--out", out]) == 2
    said = capsys.readouterr().err.strip().removeprefix("auv-fmu: ")
    with pytest.raises(ValueError, match=r".") as mistake:
        simulate("fig4", {name: str(value)})
    assert str(mistake.value) == said


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"system": "fig44"}, "did you mean fig4"),
        ({"system": "mine.toml"}, "mine.toml: no such file"),
        ({"system": Path("mine.ssp")}, "mine.ssp"),
        ({"system": "fig4", "stop_time": -1.0}, "must be positive"),
        ({"system": "fig4", "step": 0.0}, "must be positive"),
        ({"system": "fig4", "order": "random"}, "use one of gauss-seidel, jacobi"),
    ],
)
def test_what_cannot_be_run_is_told(arguments, complaint):
    with pytest.raises(ValueError, match=complaint):
        simulate(**arguments)


def test_system_has_its_scenarios_experiment_and_can_be_run_again():
    system = load("fig3a")
    first, second = simulate(system), simulate(system)
    assert (first.time[-1], len(first)) == (10.0, 501)
    assert np.array_equal(first.rows, second.rows)
    changed = simulate(system, {"plant.tau.u": 20.0}, stop_time=1.0)
    assert changed["plant.nu.u"][-1] > 1.5 * first["plant.nu.u"][50]
    assert simulate(system)["plant.nu.u"][-1] == first["plant.nu.u"][-1]


def test_scenario_file_is_found_by_text_and_by_path(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('stop_time = 0.1\n[parameters]\n"controller.K1[1]" = 12.0\n')
    for system in (file, str(file), load(file)):
        result = simulate(system)
        assert (result.time[-1], result.parameters["controller.K1[1]"]) == (0.1, 12.0)


def test_unknown_names_are_key_errors_with_a_suggestion(result):
    with pytest.raises(KeyError, match=r"plant\.eta\.x"):
        result["plant.eta"]
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


def test_repr_is_one_line_and_tells_a_failure(result):
    assert repr(result) == "<Result fig4: 6 rows of 103 columns, 0 to 0.1 s, gauss-seidel>"
    failed = simulate("fig4", {"plant.d11": 1e4})
    assert failed.failure is not None
    assert failed.failure in repr(failed)
    assert 0 < len(failed) < 5001


def test_saved_result_is_that_of_the_command_line(result, tmp_path):
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
