"""Commands refuse bad input in one line with status 2, and write nothing."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from orchestrator.commands.main import main
from support.machine import contents
from support.texts import mentions

#: Commands, with `?` where the name of the file goes, and the ending that it then has.
COMMANDS = {
    "run": (["run", "?"], ("toml", "ssp")),
    "export": (["export", "?"], ("toml", "ssp")),
    "animate": (["animate", "?"], ("toml", "ssp")),
    "hosts": (["hosts", "--scenario", "?"], ("toml", "ssp")),
    "verify": (["verify", "?"], ("csv", "parquet")),
    "verify with": (["verify", "file.csv", "--scenario", "?"], ("toml", "ssp")),
    "plot": (["plot", "?"], ("csv", "parquet")),
    "view": (["view", "?"], ("csv", "parquet")),
    "report": (["report", "?"], ("toml",)),
}
KINDS = (
    "missing", "folder", "pipe", "device", "loop", "binary", "endless", "long name", "zero in name",
    "below a file", "without permission",
)  # fmt: skip

#: Bad texts, by the names of their files.
TEXTS = {
    "arrays.toml": f"only = {'[' * 5000}{']' * 5000}",
    "bool.toml": "stop_time = true",
    "compare.toml": 'stop_time = 0.1\ncompare = "nosuch"',
    "digits.toml": f"stop_time = {'9' * 400}",
    "falling.csv": "time,a.b\n1,2\n0,1\n",
    "figure.toml": "figure = 'none'",
    "keys.toml": f"parameters.{'.'.join('a' * 2000)} = 1",
    "misspelt.toml": '[components]\nplanner = "MotionPlaner"',
    "missing.toml": '[components]\ncontroller = "missing.fmu"',
    "more_digits.toml": f"stop_time = {'9' * 5000}",
    "named.toml": '[components]\n"a-b" = "AuvPlant"',
    "inner.toml": '[components]\n"plant.b" = "AuvPlant"',
    "each.toml": 'vehicles = 2\n[parameters]\n"auv*.plant.eta0.y" = { each = [1.0] }\n',
    "only.toml": 'only = ["pilot"]',
    "own.py": "",
    "parameter.toml": f"parameters.plant.m11 = 0x{'f' * 5000}",
    "rows.csv": "time,a.b\n\n",
    "unwired.toml": '[wires]\n"plant.tua" = false',
    "wire.toml": '[wires]\n"controller.dy" = "plant.dy"',
    "zero.toml": 'parameters.controller.saturation = "tanh\\u0000x"',
}


@pytest.fixture
def workplace(workplace: Path) -> Path:
    """A folder with a table in it."""
    Path("file.csv").write_text("time,plant.eta.x\n0,2\n0.02,2\n")
    return workplace


def bad_file(kind: str, ending: str) -> str:
    """Make a bad file, and return its name."""
    path = Path(f"bad.{ending}")
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "binary":
        path.write_bytes(bytes(range(256)) * 100)
    elif kind == "endless":
        # Takes no room on the disk.
        with path.open("wb") as file:
            file.truncate(10**12)
    elif kind == "without permission":
        path.write_text("time\n")
        path.chmod(0)
    elif kind == "long name":
        return f"{'x' * 300}.{ending}"
    elif kind == "zero in name":
        return f"a\0b.{ending}"
    elif kind == "below a file":
        return f"file.csv/bad.{ending}"
    return str(path)


@pytest.mark.parametrize("kind", KINDS)
def test_bad_file_is_refused_in_one_line(workplace: Path, refused: Callable[..., str], kind: str):
    if kind == "without permission" and os.geteuid() == 0:
        pytest.skip("root may read everything")
    # Commands read files by the same functions: each meets some kinds.
    commands, names = [*COMMANDS.values()][KINDS.index(kind) % 3 :: 3], {}
    for arguments, ending in ((words, ending) for words, endings in commands for ending in endings):
        if ending == "parquet":
            pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
        name = names[ending] = names.get(ending) or bad_file(kind, ending)
        shown = name if kind != "zero in name" else r"a\x00b"
        assert shown in refused(*(name if word == "?" else word for word in arguments))


@pytest.mark.parametrize(
    ("command", "numbers"),
    [
        ("run fig4 --stop-time", "nan inf -1 0"),
        ("run fig4 --step", "nan -inf 0 1e-320"),
        ("run fig4 --stop-time 0.1 --interval", "nan -1 0"),
        ("run fig4 --isolate --step-timeout", "nan inf 0"),
        ("run fig4 --checkpoint-every", "nan 1e400 0"),
        ("run fig4 --real-time", "nan inf 0"),
        ("export fig4 --step", "nan 0"),
        ("animate fig4 --step", "nan 0"),
        ("animate fig4 --fps", "0 -1 99999999999999999999"),
        ("verify file.csv --tolerance", "nan -1"),
        ("verify file.csv --step", "nan 0"),
        ("hosts --steps", "0 -1 99999999999999999999"),
    ],
)
def test_number_that_makes_no_sense_is_refused(workplace, refused, command, numbers):
    for number in numbers.split():
        *words, option = command.split()
        assert refused(*words, f"{option}={number}")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ("run fig99", "'fig99'; fig4"),
        ("run fig4 --set plant.m11", "COMPONENT.PARAMETER=VALUE"),
        ("run fig4 --set m11=3", "'m11' COMPONENT.PARAMETER; plant.m11"),
        ("run fig4 --set controller.K1=5", "controller.K1 3 controller.K1[1], controller.K1[3]"),
        ("run fig4 --strict --interval 0.001", "--interval 0.001 0.02"),
        ("run fig4 --strict --interval 0.03", "--interval 0.03 0.02 0.04"),
        ("run fig4 --strict --set plant.eta0.theta=90", "plant.eta0.theta 90 1.5708"),
        ("run own.py", "auv-fmu build own.py"),
        ("run fig4 --set plant.noise.seed=4294967297", "plant.noise.seed"),
        ("run fig4 --set plant.noise.seed=1_0", "integer"),
        ("run fig4 --set plant.m11=\u0662", "real"),
        ("run fig4 --stop-time 1e300", "steps"),
        ("run fig4 --out file.csv/below", "--out"),
        (["run", "fig4", "--out", ""], "--out"),
        ("run fig4 --order=", "--order="),
        ("run fig4 --order random", "random"),
        ("run fig4 --columns plant.tua.*", "plant.tua.*"),
        ("run fig4 --stop-time 0.1 --out taken", "taken/result.csv"),
        ("run fig4 --isolate --loop compiled", "compiled isolated"),
        ("run fig4 --step-timeout 3", "--isolate"),
        ("run fig4 --variant B", "fig4 variants"),
        ("run fig4 --out r --resume", "r/checkpoint"),
        ("run fig4 --out taken --force --checkpoint-every 0", "checkpoint positive"),
        *(
            (f"run {name}", reason)
            for name, reason in (
                ("arrays.toml", "nested"),
                ("bool.toml", "true number"),
                ("compare.toml", "'nosuch' name components"),
                ("digits.toml", "finite"),
                ("figure.toml", "'none'"),
                ("keys.toml", "nested"),
                ("misspelt.toml", "planner 'MotionPlaner' MotionPlanner"),
                ("missing.toml", "missing.fmu"),
                ("more_digits.toml", "more_digits.toml limit"),
                ("named.toml", "a-b"),
                ("inner.toml", "plant.b"),
                ("each.toml", "auv*.plant.eta0.y"),
                ("only.toml", "pilot"),
                ("parameter.toml", "real"),
                ("unwired.toml", "'plant.tua' plant.tau"),
                ("wire.toml", "controller dy dy.*"),
                ("zero.toml", "saturation tanh, algebraic"),
                ("auv.ssp --kind native", "auv.ssp kind fmi"),
            )
        ),
        ("gains --set plant.ell=0", "plant.ell"),
        ("gains --set controller.saturation=sigmoid", "tanh, algebraic"),
        ("export fig4 --fmi 3", "--fmi 3 --kind native"),
        ("export fig4 --kind native --fmi 3 --format osp", "libcosim 3.0"),
        ("build --out file.csv/below", "file.csv/below"),
        ("build --platforms linux64", "--platforms --kind native"),
        ("build --kind native --loader plain", "--loader --kind python"),
        ("build --kind native --platforms win32", "'win32' 2.0"),
        ("build --kind native --platforms x86_64-linux", "--fmi 3"),
        ("build own.py --kind native", "own.py"),
        (["plot", ""], "plot"),
        ("plot .", "result"),
        (["plot", 300 * "a"], "aaa"),
        ("plot plant.y", "plant.y"),
        ("plot file.csv plant.yy", "'plant.yy'"),
        ("plot file.csv --out plot.txt", ".png .svg .pdf"),
        ("plot rows.csv a.b", "rows.csv"),
        ("plot falling.csv a.b", "falling.csv"),
        ("view nowhere", "nowhere"),
        ("view file.csv --out page.txt", ".html"),
        ("animate fig4 --stop-time 0.1 --out film.avi", ".gif"),
        ("sweep nothing", "'nothing'"),
        ("sweep attraction --workers 0", "--workers 0"),
        ("sweep attraction --workers 2 --scheduler nowhere", "--workers"),
        pytest.param(
            "sweep attraction --out file.csv", "file.csv",
            marks=pytest.mark.skipif(
                find_spec("pyarrow") is None, reason="pyarrow is not installed"
            ),
        ),
        ("report --out file.csv/below", "--out"),
        ("hosts nobody", "nobody"),
        ("new controller 3x", "'3x'"),
        ("new controller random", "random Python"),
        ("new controller class", "class Python"),
        ("new controller Law taken", "taken"),
        ("new controller Law file.csv", "file.csv"),
    ],
    ids=str,
)  # fmt: skip
def test_bad_input_is_one_line_and_status_2(workplace, native, refused, arguments, reason):
    words = arguments.split() if isinstance(arguments, str) else arguments
    for name, text in TEXTS.items():
        Path(name).write_text(text)
    Path("taken/result.csv").mkdir(parents=True)
    shutil.copy(native / "auv.ssp", workplace)
    before = contents(workplace)
    assert mentions(refused(*words), reason)
    assert contents(workplace) == before


def test_bad_usage_is_status_2():
    with pytest.raises(SystemExit) as stop:
        main(["run", "fig4", "--kind", "random"])
    assert stop.value.code == 2
