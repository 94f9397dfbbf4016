"""Templates of components are valid in both kinds, and are built again when they change."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu

from fmus.kinds import NATIVE, PYTHON
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from orchestrator.runs import own_components
from orchestrator.runs.own_components import (
    LIKENESSES,
    build_own,
    changes,
    new_component,
    new_controller,
)
from support.own import write
from support.tiers import slow

#: The controller of the closed loop, which is created with its FMU.
OF_THE_LOOP = "controller of the loop"


@pytest.fixture(params=[OF_THE_LOOP, LIKENESSES[0], *slow(*LIKENESSES[1:])])
def made(request, tmp_path) -> Path:
    """Script of a component from a template."""
    if request.param == OF_THE_LOOP:
        script, *_ = new_controller("tiny_thing", tmp_path / "tiny")
    else:
        script, *_ = new_component("tiny_thing", tmp_path / "tiny", request.param)
    return script


def test_files_contain_the_name_and_no_other(made: Path):
    files = [path for path in made.parent.iterdir() if path.name[0] != "."]
    texts = {path.name: path.read_text() for path in files if path.suffix != ".fmu"}
    assert {*texts} == {"tiny_thing.py", "test_tiny_thing.py", "tiny_thing.toml", "README.md"}
    for text in texts.values():
        assert "own_" not in text
        assert "OwnCo" not in text
        assert max(map(len, text.splitlines())) <= 100 or text == texts["README.md"]


def test_its_tests_pass(made: Path):
    process = subprocess.run(
        [sys.executable, "-P", "-m", "pytest", "-q", "-p", "no:cacheprovider", str(made.parent)],
        cwd=made.parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stdout


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_both_kinds_give_the_same_numbers(made: Path, tmp_path: Path):
    tables = []
    for kind in (PYTHON, NATIVE):
        fmu = build_own(made, tmp_path / kind, kind=kind)
        assert fmu.name == "TinyThing.fmu"
        assert validate_fmu(str(fmu)) == []
        tables.append(
            fmpy.simulate_fmu(
                str(fmu), stop_time=5.0, step_size=0.1, output_interval=0.1,
                start_values={
                    variable.name: 0.3
                    for variable in fmpy.read_model_description(fmu).modelVariables
                    if variable.causality == "input"
                },
            )
        )  # fmt: skip
    assert tables[0].tobytes() == tables[1].tobytes()
    assert len(tables[0]) == 51


def test_it_has_no_problems_and_its_scenario_runs(made: Path, capsys):
    assert main(["check", str(made)]) == 0
    assert capsys.readouterr().out == f"{made}: no problems found\n"
    assert main(["build", str(made)]) == 0
    scenario = made.with_suffix(".toml")
    assert main(["check", str(scenario)]) == 0
    assert main(["run", str(scenario), "--out", str(made.parent / "results")]) == 0
    assert (made.parent / "results/result.csv").is_file()
    told_of_an_event = "tiny_thing: t = " in capsys.readouterr().err
    assert told_of_an_event == ("[[events]]" in scenario.read_text())


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("my-law", "'my-law': not a name for a component; use letters, digits and underscores"),
        ("class", "'class': class is a keyword of Python; choose another name"),
        ("json", "'json': json is already a module of Python; choose another name"),
    ],
)
def test_names_that_cannot_be_are_refused(tmp_path, name, why):
    with pytest.raises(InputError, match=why):
        new_component(name, tmp_path / "it")
    with pytest.raises(InputError, match=why.replace("component", "controller")):
        new_controller(name, tmp_path / "it")


def test_a_folder_that_is_not_empty_is_left_alone(tmp_path):
    (tmp_path / "mine").touch()
    with pytest.raises(InputError, match="is not empty; choose a new or empty folder"):
        new_component("own_thing", tmp_path)


def test_command_shows_the_next_steps(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "component", "RainBarrel", "--like", "plant"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "rain_barrel/rain_barrel.py",
        "rain_barrel/test_rain_barrel.py",
        "rain_barrel/rain_barrel.toml",
        "rain_barrel/README.md",
        "edit rain_barrel/rain_barrel.py, then test, build and run it:",
        "  pytest rain_barrel/test_rain_barrel.py",
        "  auv-fmu build rain_barrel/rain_barrel.py",
        f"  auv-fmu run rain_barrel/rain_barrel.toml --out rain_barrel{os.sep}results",
    ]


def test_command_tells_how_to_install_pytest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("orchestrator.commands.build.find_spec", lambda name: None)
    assert main(["new", "component", "my_pid"]) == 0
    out = capsys.readouterr().out
    assert "  pip install pytest\n  pytest my_pid/test_my_pid.py\n" in out


@pytest.mark.parametrize(
    ("options", "tests", "test"),
    [
        ([], ["my_law/test_my_law.py"], ["  pytest my_law/test_my_law.py"]),
        (["--python"], [], []),
    ],
)
def test_controller_comes_with_its_fmu(tmp_path, monkeypatch, capsys, options, tests, test):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "controller", "MyLaw", *options]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "my_law/my_law.py",
        *tests,
        "my_law/my_law.toml",
        "my_law/README.md",
        "my_law/MyLaw.fmu",
        f"edit my_law/my_law.py, then {'test, ' * bool(test)}build and run it:",
        *test,
        "  auv-fmu build my_law/my_law.py",
        f"  auv-fmu run my_law/my_law.toml --out my_law{os.sep}results",
    ]
    assert {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("my_law/[!.]*")} == {
        "my_law/my_law.py", *tests, "my_law/my_law.toml", "my_law/README.md", "my_law/MyLaw.fmu",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["PIDController", *slow("RainBarrel", "rain_barrel")])
def test_a_folder_is_checked_and_built_by_its_name(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    folder = "pid_controller" if name == "PIDController" else "rain_barrel"
    assert main(["new", "component", name]) == 0
    assert main(["check", folder]) == 0
    assert main(["build", folder]) == 0
    built = "PidController" if name == "PIDController" else "RainBarrel"
    assert [path.stem for path in Path(folder).glob("*.fmu")] == [built]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["build", "none.py"], "none.py: no such Python file"),
        (["build", "."], "auv-fmu: .: has no "),
        (["build", "--watch"], "--watch is for your own component: name its script"),
        (["check", "none.py"], "none.py: no such Python file"),
        (
            ["build", "own_lag.py", "--kind", "native", "--loader", "plain"],
            "cannot build the FMUs: --loader is for --kind python: the other kind loads no Python",
        ),
        (
            ["build", "own_lag.py", "--fmi", "3"],
            "cannot build the FMUs: --platforms, --fmi 3 and --arrays need --kind native",
        ),
        (
            ["build", "slave.py", "--fmi", "3"],
            "cannot build the FMUs: --platforms, --fmi 3 and --arrays need --kind native",
        ),
        (
            ["build", "slave.py", "--kind", "native"],
            "slave.py: not a component: it has no function outputs()",
        ),
    ],
)
def test_impossible_commands_are_refused_in_one_line(tmp_path, monkeypatch, capsys, arguments, why):
    monkeypatch.chdir(tmp_path)
    write(tmp_path)
    (tmp_path / "slave.py").write_text("class Own:\n    pass\n")
    assert main(arguments) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert why in message


def test_check_lists_problems(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, ("State(state.x -", "State(state.x ** 0.5 -"))
    assert main(["check", "own_lag.py"]) == 2
    assert capsys.readouterr().out == (
        "problem: own_lag.py:55: ** with other than a whole constant is not in the language of "
        "equations; write math.pow(x, y), or sqrt(x)\n"
    )


def test_changes_are_seen_in_the_script_and_beside_it(tmp_path, monkeypatch):
    monkeypatch.setattr(own_components, "_INTERVAL", 0.01)
    script = write(tmp_path)
    (tmp_path / "package").mkdir()
    seen = changes(script)
    next(seen)
    for path in (script, tmp_path / "beside.py", tmp_path / "package/in.py"):
        path.write_text(f"x = '{path.name}'\n")
        next(seen)
    (tmp_path / "beside.py").unlink()
    next(seen)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
def test_watch_builds_again_until_the_user_ends_it(tmp_path):
    script = write(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "orchestrator", "build", "own_lag.py", "--watch"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline().startswith("OwnLag.fmu, ")
        first = (tmp_path / "OwnLag.fmu").read_bytes()
        write(tmp_path, ("] = 0.5", "] = 0.7"))
        assert process.stdout.readline().startswith("OwnLag.fmu, ")
        assert (tmp_path / "OwnLag.fmu").read_bytes() != first
        script.write_text("def outputs(\n")
        assert process.stderr.readline().startswith("auv-fmu: own_lag.py:1: ")
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
        assert process.stderr.read() == "auv-fmu: interrupted\n"


def test_a_folder_is_built_in_itself(tmp_path):
    folder = tmp_path / "own_lag"
    folder.mkdir()
    write(folder)
    assert build_own(folder) == folder / "OwnLag.fmu"
