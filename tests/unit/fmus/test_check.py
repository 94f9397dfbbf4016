"""All that is wrong with a component is listed at once, by file and line."""

from __future__ import annotations

import subprocess
import sys

from support.own import write


def mistakes(*arguments: object) -> tuple[int, list[str]]:
    process = subprocess.run(
        [sys.executable, "-P", "-m", "fmus.check", *map(str, arguments)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return process.returncode, (process.stdout + process.stderr).splitlines()


def test_of_a_good_component_nothing_is_said(tmp_path):
    assert mistakes(write(tmp_path)) == (0, [])


def test_everything_is_listed_in_the_order_of_the_lines(tmp_path, monkeypatch):
    write(
        tmp_path,
        ("x = state.x -", "y = [1.0, 2.0]\n    x = state.x ** 2 -"),
        ('Variable("m", "Value")', 'Variable("m", "Value", tunable=True)'),
        ("from math import expm1", "from beside import expm1, half"),
    )
    (tmp_path / "beside.py").write_text(
        "from math import expm1\n\n\ndef half(x: float) -> float:\n    return sum((x, x)) / 4.0\n"
    )
    monkeypatch.chdir(tmp_path)
    status, lines = mistakes("own_lag.py")
    assert status == 0
    assert [line.partition(" is ")[0] for line in lines] == [
        "beside.py:5: the name sum",
        "own_lag.py:39: Outputs.x",
        "own_lag.py:57: List",
        "own_lag.py:58: the operator Pow",
    ]


def test_what_only_the_translation_finds_is_told(tmp_path, monkeypatch):
    write(tmp_path, ("return State(x), Outputs(x)", "return State(x), Outputs(1)"))
    monkeypatch.chdir(tmp_path)
    status, [line] = mistakes("own_lag.py")
    assert status == 0
    assert line.startswith("own_lag.py:58: ")


def test_a_state_too_large_for_the_stack_is_told(tmp_path, monkeypatch):
    write(tmp_path, ("    x: float\n", f"    x: float\n    line: tuple[{'float, ' * 5000}]\n"))
    monkeypatch.chdir(tmp_path)
    first, *_ = mistakes("own_lag.py")[1]
    assert first == "own_lag.py: a state of 5001 numbers; C takes at most 5000"


def test_an_expression_that_is_too_long_is_told(tmp_path, monkeypatch):
    write(tmp_path, ("return State(x), ", f"x = {'x + ' * 3000}x\n    return State(x), "))
    monkeypatch.chdir(tmp_path)
    assert "own_lag.py: an expression is too long: take it apart" in mistakes("own_lag.py")[1]


def test_a_module_that_cannot_be_imported_is_told_beside_the_rest(tmp_path, monkeypatch):
    write(
        tmp_path,
        ("from math import expm1", "import nothing_there\nfrom math import expm1"),
        ("x = state.x -", "x = state.x ** 2 -"),
    )
    monkeypatch.chdir(tmp_path)
    assert [line.split(";")[0] for line in mistakes("own_lag.py")[1]] == [
        "own_lag.py:8: ModuleNotFoundError: No module named 'nothing_there'",
        "own_lag.py:58: the operator Pow is not in the language of equations",
    ]


def test_what_is_no_component_is_refused(tmp_path):
    path = tmp_path / "own.py"
    path.write_text("x = 1\n")
    assert mistakes(path) == (
        2,
        [
            f"{path}: not a component, which has functions begin() and advance() (see "
            "`auv-fmu new`); if it has a class of PythonFMU, build it and check its FMU: "
            f"auv-fmu build {path}"
        ],
    )
