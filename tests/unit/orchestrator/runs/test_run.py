"""`simulate` and `load`, the columns of tables, and checkpoints."""

from __future__ import annotations

import inspect
from copy import deepcopy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import System
from orchestrator.machine.errors import InputError
from orchestrator.runs.run import (
    check_gives_states,
    checkpoints_of,
    leave_checkpoints,
    selected_columns,
)
from support.archives import fmu, variable
from support.linear import SINE, linear, system_of
from support.small_fmus import connected
from support.texts import mentions


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
def test_values_may_have_types_of_python_and_numpy(name, value, taken):
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
def test_simulate_and_the_command_line_report_mistakes_in_the_same_words(
    name, value, tmp_path, capsys
):
    out = str(tmp_path / "out")
    assert main(["run", "fig4", "--set", f"{name}={value}", "--out", out]) == 2
    message = capsys.readouterr().err.strip().removeprefix("auv-fmu: ")
    with pytest.raises(ValueError, match=r".") as mistake:
        simulate("fig4", {name: str(value)})
    assert str(mistake.value) == message


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"system": "fig44"}, "did you mean fig4"),
        ({"system": "mine.toml"}, "mine.toml: no such file"),
        ({"system": Path("mine.ssp")}, "mine.ssp"),
        ({"system": "fig4", "stop_time": -1.0}, "must be positive"),
        ({"system": "fig4", "step": 0.0}, "must be positive"),
        ({"system": "fig4", "order": "random"}, "use one of feedthrough, gauss-seidel, jacobi"),
    ],
)
def test_systems_and_options_that_cannot_be_run_are_refused(arguments, complaint):
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


def test_dictionary_is_a_scenario_like_its_file(tmp_path):
    table = {
        "title": "PD",
        "stop_time": 0.1,
        "components": {"controller": "PdController"},
        "wires": {"controller.dy": "plant.dy"},
        "parameters": {"plant.noise.std": 0.0, "controller": {"lambda": 2.0}},
    }
    file = tmp_path / "scenario.toml"
    file.write_text(
        'title = "PD"\nstop_time = 0.1\ncomponents.controller = "PdController"\n'
        '[wires]\n"controller.dy" = "plant.dy"\n'
        "[parameters]\nplant.noise.std = 0.0\ncontroller.lambda = 2.0\n"
    )
    before = deepcopy(table)
    made, written = simulate(table), simulate(file)
    assert np.array_equal(made.rows, written.rows)
    assert made.metrics() == written.metrics()
    assert (repr(made), made.parameters["controller.lambda"]) == (repr(written), 2.0)
    assert table == before
    assert load(table).parameters == load(file).parameters


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        ({"stop_tim": 1.0}, "unknown entry 'stop_tim'; did you mean stop_time"),
        ({1: 1.0}, "scenario: 1: write names of entries as texts"),
        ({"events": [{"at": 0.5, 2: 1}]}, "event 1: 2: write names of entries as texts"),
        ({"components": {"controller": 3}}, "controller': 3}: write a table of names"),
        (
            {"components": {"controller": "Nope"}},
            "controller: the bundle has no FMU 'Nope'; there are AcousticLink, .*Sea",
        ),
        (
            {"components": {"controller": "PDController"}},
            "controller: the bundle has no FMU 'PDController'; did you mean PdController?",
        ),
        ({"parameters": {"plant.eta0": [1.0]}}, "plant.eta0: takes 6 values, not 1"),
    ],
)
def test_mistakes_in_a_dictionary_are_refused(table, complaint):
    with pytest.raises(ValueError, match=complaint):
        simulate(table)


@pytest.mark.parametrize(
    ("given", "pose"),
    [
        ({"plant.eta0": [1, 2, -3, 0.1, 0, 0.2]}, (1.0, 2.0, -3.0, 0.1, 0.0, 0.2)),
        ({"plant.eta0": np.arange(6) / 8}, (0.0, 0.125, 0.25, 0.375, 0.5, 0.625)),
        ({"plant.eta0": "1, 2,-3,0,0,0"}, (1.0, 2.0, -3.0, 0.0, 0.0, 0.0)),
        ({"plant.eta0": [0] * 6, "plant.eta0.y": 7}, (0.0, 7.0, 0.0, 0.0, 0.0, 0.0)),
        ({"plant.eta0.y": 7, "plant.eta0": [0] * 6}, (0.0,) * 6),
    ],
)
def test_a_list_sets_the_members_of_a_group(given, pose):
    members = [f"plant.eta0.{name}" for name in ("x", "y", "z", "phi", "theta", "psi")]
    for result in (
        simulate("fig4", given, stop_time=0.02),
        simulate({"parameters": dict(given)}, stop_time=0.02),
    ):
        assert tuple(result.parameters[name] for name in members) == pose
        assert tuple(result.group("plant.eta.x", "plant.eta.y", "plant.eta.z")[0]) == pose[:3]


# Columns


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> System:
    path = fmu(
        tmp_path_factory.mktemp("fmu") / "a.fmu",
        variable("y.x", "output"), variable("u", "input"), variable("k", "parameter"),
        variable("y.z", "output"), variable("n", "output", "Integer"),
    )  # fmt: skip
    return connected("s", dict.fromkeys("ba", path))


@pytest.mark.parametrize(
    ("wanted", "columns"),
    [
        ("outputs", "b.y.x b.y.z b.n a.y.x a.y.z a.n"),
        ("a.y.*", "a.y.x a.y.z"),
        ("a.u", "a.u"),
        # In the order of the table, each once.
        (" a.n ,b.*, ,*.n", "b.u b.y.x b.y.z b.n a.n"),
    ],
)
def test_columns_are_chosen_by_patterns(system, wanted, columns):
    assert selected_columns(system, wanted) == columns.split()
    assert selected_columns(system, wanted, is_companion=True) == columns.split()


def test_all_columns_need_no_names(system):
    assert selected_columns(system, "all") is None


def test_a_pattern_without_columns_is_refused_unless_another_run_has_them(system):
    for wanted in ("a.k", "a.u,c.*"):
        with pytest.raises(InputError, match=wanted[-3:].replace("*", r"\*")):
            selected_columns(system, wanted)
    assert selected_columns(system, "a.u,c.*", is_companion=True) == ["a.u"]
    for is_companion in (False, True):
        with pytest.raises(InputError, match="--columns"):
            selected_columns(system, " , ", is_companion)


# Checkpoints


def test_checkpoints_are_made_only_if_requested(tmp_path):
    assert checkpoints_of([], [tmp_path], None, resume=False) == []
    with pytest.raises(InputError) as error:
        checkpoints_of([], [tmp_path / "none"], None, resume=True)
    assert mentions(str(error.value), "none --checkpoint-every")


def test_checkpoints_of_a_complete_run_are_removed_and_others_are_named(tmp_path, monkeypatch):
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
