"""FMUs of the user's own scripts: their contents, and warnings if they are out of date."""

from __future__ import annotations

import re
import shutil
import warnings
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from fmus.discovery import origin_of
from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from support.own import write
from support.texts import mentions

#: Packages that controllers of researchers use, if they are installed.
PACKAGES = [
    name
    for name in ("numpy", "scipy.optimize", "pandas", "matplotlib.pyplot", "casadi")
    if find_spec(name.partition(".")[0])
]

needs_compiler = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

IMPORTS = f"import {', '.join(PACKAGES)}\nfrom scipy.linalg import solve\n"

SCENARIO = 'stop_time = 0.1\nstep = 0.1\nonly = ["mine"]\n[components]\nmine = "Own.fmu"\n'

SLAVE = """\
import folder.inner, \\
    math
from pathlib import Path
from pythonfmu import Fmi2Causality, Fmi2Slave, Real
if True: import beside

HERE = Path(__file__).parent
TABLE = [*map(float, (HERE / "data" / "table.txt").open())]


class Own(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = float(HERE.joinpath("made.txt").read_text())
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = beside.GAIN * folder.inner.GAIN * TABLE[1]
        return True
"""

FILES = {
    "own.py": SLAVE,
    "beside.py": "# coding: latin-1\nNAME = '\xfc'\nGAIN = 2.0\n",
    "folder/inner.py": "GAIN = 3.0\n",
    "data/table.txt": "1.0\n5.0\n",
    "data/unused.txt": "",
    "made.txt": "7.0",
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a script, modules and data files beside it, and its FMU."""
    folder = tmp_path_factory.mktemp("built")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="latin-1")
    assert main(["build", str(folder / "own.py")]) == 0
    return folder


@pytest.fixture
def own(built: Path, workplace: Path) -> Path:
    """A copy of it, which is the current folder."""
    shutil.copytree(built, workplace, dirs_exist_ok=True)
    return workplace


def test_a_script_runs_with_the_packages_of_researchers(workplace: Path):
    """The packages belong to the host, and are not in the FMU."""
    text = SLAVE.replace("import folder.inner, \\\n    math", IMPORTS).replace(
        "if True: import beside", ""
    )
    text = text.replace('HERE.joinpath("made.txt").read_text()', "0").replace("TABLE =", "#")
    text = text.replace("beside.GAIN * folder.inner.GAIN * TABLE[1]", "solve([[2.0]], [1.0])[0]")
    Path("own.py").write_text(text)
    assert main(["build", "own.py"]) == 0
    assert [*simulate("Own.fmu", stop_time=0.2, step=0.1)["Own.y"]] == [0.0, 0.5, 0.5]
    with zipfile.ZipFile("Own.fmu") as archive:
        names = {name.split("/")[1] for name in archive.namelist() if name[:10] == "resources/"}
    assert {re.sub(r"_[0-9a-f]{12}", "", name) for name in names} == {
        "Own_fmu.py", "own.py", "fmus", "pythonfmu", "guid.txt", "slavemodule.txt",
    }  # fmt: skip


def test_a_script_runs_with_its_modules_and_data_files(own: Path, tmp_path_factory):
    other = tmp_path_factory.mktemp("other")
    assert main(["build", "own.py", "--out", str(other)]) == 0
    assert (other / "Own.fmu").read_bytes() == Path("Own.fmu").read_bytes()
    with zipfile.ZipFile("Own.fmu") as archive:
        names = {re.sub(r"_[0-9a-f]{12}", "", name) for name in archive.namelist()}
    assert {name.removeprefix("resources/") for name in names} >= {*FILES} - {"data/unused.txt"}
    assert "resources/data/unused.txt" not in names
    for name in FILES:
        Path(name).unlink()
    result = simulate("Own.fmu", stop_time=0.2, step=0.1)
    assert [*result["Own.y"]] == [7.0, 30.0, 30.0]


@needs_compiler
def test_data_of_a_component_are_in_its_fmu(workplace: Path):
    change = "__author__ =", "START = float(Path(__file__).with_name('start.txt').read_text())\n__a"
    write(
        workplace,
        (change[0], f"from pathlib import Path\n{change[1]}uthor__ ="),
        ("parameters.x0", "parameters.x0 * START"),
    )
    Path("start.txt").write_text("3.0")
    assert main(["build", "own_lag.py", "--kind", "native", "--out", "out"]) == 0
    Path("start.txt").unlink()
    Path("own_lag.py").unlink()
    assert simulate("out/OwnLag.fmu", stop_time=0.1, step=0.1)["OwnLag.x"][0] == 3.0


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The line with which a command refuses something."""
    capsys.readouterr()
    assert main([*arguments]) == 2
    [line] = capsys.readouterr().err.splitlines()
    return line


def test_data_in_the_current_folder_are_refused_with_the_line(own: Path, capsys):
    Path("own.py").write_text(
        SLAVE.replace('(HERE / "data" / "table.txt")', 'Path("data/table.txt")')
    )
    line = 1 + SLAVE[: SLAVE.index("TABLE =")].count("\n")
    output = refusal(capsys, "build", "own.py")
    assert mentions(output, f"own.py:{line}: data/table.txt Path(__file__) Own.fmu removed")


def test_a_failed_build_leaves_no_fmu_of_the_script(own: Path, capsys):
    others = [Path(name) for name in ("Kept.fmu", "folder/Own.fmu", "Other.fmu")]
    for other in others[:2]:
        shutil.copy("Own.fmu", other)
    others[2].write_bytes(b"no FMU")
    Path("beside.py").write_text("1 / 0\n")
    output = refusal(capsys, "build", "own.py")
    assert mentions(output, "beside.py:1: ZeroDivisionError Own.fmu removed")
    assert not Path("Own.fmu").exists()
    assert all(other.exists() for other in others)
    Path("own.toml").write_text(SCENARIO)
    for name in ("Own.fmu", "own.toml"):
        assert mentions(refusal(capsys, "run", name), "Own.fmu: auv-fmu build own.py")


def change(name: str) -> Callable[[], object]:
    return lambda: Path(name).write_bytes(Path(name).read_bytes() + b"\n")


#: Changes after a build, and the file that is then named.
CHANGES = {
    "ends of lines": (
        lambda: Path("beside.py").write_bytes(
            Path("beside.py").read_bytes().replace(b"\n", b"\r\n")
        ),
        None,
    ),
    "others": (lambda: [Path(name).touch() for name in ("data/unused.txt", "new.py")], None),
    "no script": (lambda: Path("own.py").unlink(), None),
    "script": (change("own.py"), "own.py"),
    "module in a folder": (change("folder/inner.py"), "folder/inner.py"),
    "data": (change("data/table.txt"), "data/table.txt"),
    "no data": (lambda: Path("made.txt").unlink(), "made.txt"),
}


def in_python(action: Callable[[], object]) -> str:
    with warnings.catch_warnings(record=True) as output:
        warnings.simplefilter("always")
        action()
    return "\n".join(str(warning.message) for warning in output)


def test_an_fmu_older_than_its_script_is_never_run_in_silence(own: Path, capsys):
    """Each change with each command; a copy under another name may be old."""
    before = {path: path.read_bytes() for path in own.rglob("*.*") if path.is_file()}
    Path("own.toml").write_text(SCENARIO)
    for doing, (action, culprit) in CHANGES.items():
        action()
        output = {}
        for arguments in (
            ["check", "own.toml"],
            ["run", "Own.fmu", "--stop-time", "0.1", "--step", "0.1", "--no-figures"],
        ):
            main([*arguments, *(["--out", "out"] if arguments[0] == "run" else [])])
            output[" ".join(arguments)] = "".join(capsys.readouterr())
        output["simulate"] = in_python(lambda: simulate("own.toml"))
        output["load"] = in_python(lambda: load("Own.fmu"))
        for command, text in output.items():
            is_named = mentions(text, f"Own.fmu older {culprit} (auv-fmu build own.py)")
            assert is_named == (culprit is not None), (doing, command, text)
        shutil.copy("Own.fmu", "Kept.fmu")
        assert in_python(lambda: load("Kept.fmu")) == ""
        for path, content in before.items():
            path.write_bytes(content)


@needs_compiler
def test_an_fmu_in_another_folder_of_the_project_is_compared_too(workplace: Path):
    Path("own_lag").mkdir()
    write(workplace / "own_lag")
    options = ["--kind", "native", "--fmi", "3", "--out", "out/deep"]
    assert main(["build", "own_lag/own_lag.py", *options]) == 0
    before = Path("out/deep/OwnLag.fmu").read_bytes()
    assert in_python(lambda: load("out/deep/OwnLag.fmu")) == ""
    change("own_lag/own_lag.py")()
    [output] = in_python(lambda: load("out/deep/OwnLag.fmu")).splitlines()
    [command] = re.findall(r"\(auv-fmu (.*?)\)", output)
    assert main(command.split()) == 0
    assert in_python(lambda: load("out/deep/OwnLag.fmu")) == ""
    assert Path("out/deep/OwnLag.fmu").read_bytes() != before


def test_strict_refuses_an_fmu_that_is_older_than_its_script(own: Path, capsys):
    change("own.py")()
    Path("own.toml").write_text(SCENARIO)
    assert mentions(refusal(capsys, "run", "own.toml", "--strict"), "Own.fmu older own.py")
    with pytest.raises(ValueError, match=r"Own\.fmu is older than own\.py"):
        simulate("own.toml", strict=True)


def test_a_scenario_takes_a_script_and_follows_its_changes(own: Path):
    """Also one of a module beside the script, without a build by the user."""
    (own / "mine.toml").write_text(SCENARIO.replace("Own.fmu", "own.py"))

    def value() -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return float(simulate("mine.toml", kind="python")["mine.y"][-1])

    assert value() == 30.0
    (own / "beside.py").write_text("GAIN = 4.0\n")
    assert value() == 60.0
    (own / "beside.py").write_text(FILES["beside.py"], encoding="latin-1")
    assert value() == 30.0
    (own / "own.py").unlink()
    with pytest.raises(ValueError, match=r"own\.py: no such file"):
        load("mine.toml")


@pytest.mark.parametrize(
    "content",
    [
        b"[]", b"{}", b"[" * 100_000, b"\xff",
        b'{"fmu": "a", "kind": "b", "folder": ".", "script": "../c", "digests": {}}',
        b'{"fmu": "a", "kind": "b", "folder": ".", "script": "c", "digests": {"/etc/passwd": ""}}',
        b'{"fmu": "a", "kind": "b", "folder": 1, "script": 2, "digests": []}',
    ],
)  # fmt: skip
def test_a_foreign_record_is_ignored(content: bytes):
    assert origin_of(content) is None
