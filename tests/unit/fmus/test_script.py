"""A script is found and recognised, and its mistakes are reported by line."""

from __future__ import annotations

import sys

import fmpy
import pytest

from fmus.build import FAILED, main
from fmus.discovery import source_of
from fmus.script import is_component, script_in, source_of_script
from orchestrator.machine.compilers import machines_compiler
from support.own import called, write

SLAVE = "from pythonfmu import Fmi2Slave\n\n\nclass Own(Fmi2Slave):\n    pass\n"


@pytest.fixture
def built(tmp_path, monkeypatch):
    """The exit status of `fmus.build`, and its errors."""
    for name in ("own_lag", "own_slave", "beside"):
        monkeypatch.delitem(sys.modules, name, raising=False)

    def call(*arguments: object) -> tuple[int, str]:
        status, _, errors = called(main, tmp_path, *arguments)
        return status, errors.strip()

    return call


def test_a_file_or_a_folder_of_its_name_is_a_script(tmp_path):
    folder = tmp_path / "own_lag"
    folder.mkdir()
    path = write(folder)
    assert script_in(path) == path
    assert script_in(folder) == path


@pytest.mark.parametrize("name", ["own.txt", "nothing.py", "folder"])
def test_anything_else_is_none(tmp_path, name):
    (tmp_path / "own.txt").touch()
    (tmp_path / "folder").mkdir()
    why = f"{name}: no such Python file"
    if name == "folder":
        why = r"folder: has no folder\.py"
    with pytest.raises(ValueError, match=why):
        script_in(tmp_path / name)


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        (SLAVE, False),
        ("", False),
        ("def outputs():\n    pass\n", True),
        ("from other import outputs\n", True),
        ("class A:\n    def outputs(self):\n        pass\n", False),
        ("def f(:\n", True),
    ],
)
def test_functions_make_a_component(tmp_path, text, answer):
    (tmp_path / "own.py").write_text(text)
    assert is_component(tmp_path / "own.py") == answer


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("json", "json is already a module of Python; choose another name"),
        ("fmus", "fmus is already a module of Python; choose another name"),
        ("my-law", "my-law is not a name for a component; use letters, digits and underscores"),
        ("2nd", "2nd is not a name for a component"),
        ("lambda", "lambda is a word of Python; choose another name"),
        ("_own", "_own is not a name for a component"),
    ],
)
def test_names_that_no_module_can_have_are_refused(tmp_path, name, why):
    path = write(tmp_path, name=name)
    with pytest.raises(ValueError, match=f"{name}.py: {why}"):
        source_of_script(path)


@pytest.mark.parametrize(("stem", "name"), [("own_lag", "OwnLag"), ("ownLag", "OwnLag")])
def test_source_has_name_page_and_root(tmp_path, monkeypatch, stem, name):
    monkeypatch.delitem(sys.modules, stem, raising=False)
    source = source_of_script(write(tmp_path, name=stem))
    assert (source.name, source.module, source.root) == (name, stem, tmp_path.resolve())
    assert source.page == (
        f"# {name}\n\nA first-order lag, T dx/dt = u - x, solved exactly.\n\nIts page."
    )
    assert source_of("AuvPlant").root is None


#: Mistakes: what is changed, and what is said.
MISTAKES = {
    "field": (
        ('u: Annotated[float, Variable("m", "Set point")]', "u: float"),
        "own_lag.py:27: Inputs.u has no unit and no description; write u: Annotated[float, ",
    ),
    "module": (("__version__ =", "__version__ = 1 / 0 #"), "own_lag.py:14: ZeroDivisionError: div"),
    "syntax": (
        ("State(state.x -", "State(= state.x -"),
        "own_lag.py:55: SyntaxError: invalid syntax",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_told_with_file_and_line(tmp_path, monkeypatch, mistake, built):
    change, why = MISTAKES[mistake]
    write(tmp_path, change)
    monkeypatch.chdir(tmp_path)
    status, message = built("own_lag.py", "--out", tmp_path)
    assert status == FAILED
    assert message.startswith(why)
    assert "\n" not in message


def test_a_mistake_in_a_module_beside_is_told_with_its_line(tmp_path, built):
    path = write(tmp_path, ("from math import expm1", "from beside import expm1"))
    (tmp_path / "beside.py").write_text("from math import expm1\n\n1 / 0\n")
    status, message = built(path, "--out", tmp_path)
    assert (status, message) == (
        FAILED,
        f"{tmp_path}/beside.py:3: ZeroDivisionError: division by zero",
    )


def test_what_is_outside_the_language_is_told_when_it_is_to_become_c(tmp_path, monkeypatch, built):
    write(tmp_path, ("State(state.x -", "State(state.x ** 0.5 -"))
    monkeypatch.chdir(tmp_path)
    status, message = built("own_lag.py", "--kind", "native", "--out", tmp_path)
    why = "own_lag.py:55: ** with other than a whole constant is not in the language of equations"
    assert (status, message[: len(why)]) == (FAILED, why)
    assert built("own_lag.py", "--out", tmp_path) == (0, "")


@pytest.mark.parametrize("options", [[], ["--fmi", "3"]])
def test_a_slave_of_pythonfmu_runs_only_in_python(tmp_path, options, built):
    path = tmp_path / "own_slave.py"
    path.write_text(SLAVE)
    assert built(path, "--kind", "native", *options, "--out", tmp_path) == (
        2,
        f"{path}: not a component: it has no function outputs() (see `auv-fmu new`); "
        "a class of PythonFMU needs --kind python",
    )


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_modules_beside_go_into_both_kinds_and_both_give_the_same_numbers(tmp_path, built):
    path = write(tmp_path, ("from math import expm1", "from beside import expm1"))
    (tmp_path / "beside.py").write_text("from math import expm1\n\n__all__ = ('expm1',)\n")
    tables = []
    for kind in ("python", "native"):
        (tmp_path / kind).mkdir()
        assert built(path, "--kind", kind, "--out", tmp_path / kind) == (0, "")
        fmu = str(tmp_path / kind / "OwnLag.fmu")
        assert fmpy.read_model_description(fmu).description.startswith("A first-order lag")
        tables.append(
            fmpy.simulate_fmu(fmu, stop_time=2.0, output_interval=0.1, start_values={"u": 3.0})
        )
    assert tables[0].tobytes() == tables[1].tobytes()


def test_main_says_what_cannot_be_built(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["build", str(tmp_path / "no.py"), "--out", str(tmp_path)])
    assert main() == 2
    assert capsys.readouterr().err == f"{tmp_path}/no.py: no such Python file\n"
