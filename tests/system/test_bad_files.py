"""Every command meets every kind of bad file, and every number that is none."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.commands.main import main

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

#: Numbers that look odd and are none the less what they should be.
GOOD = {
    ("--stop-time", "1e-320"), ("--interval", "1e-320"), ("--interval", "inf"),
    ("--interval", "1e400"), ("--tolerance", "0"), ("--tolerance", "1e-320"),
}  # fmt: skip


@pytest.fixture
def workplace(workplace: Path) -> Iterator[Path]:
    (workplace / "file.csv").write_text("time,plant.eta.x\n0,2\n0.02,2\n")
    yield workplace
    left = {path.name for path in workplace.iterdir()}
    assert not left & {"results", "exports", "plot.png"}


def bad_file(kind: str, ending: str) -> str:
    """The name of a file that is no good."""
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


def complaint(capsys: pytest.CaptureFixture[str]) -> str:
    """What a command said, which is one line that can be read."""
    out, line = capsys.readouterr()
    assert out == ""
    assert line.startswith("auv-fmu: ")
    assert line.endswith("\n")
    assert line[:-1].isprintable()
    assert len(line) < 600
    return line


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("command", COMMANDS)
def test_bad_file_is_refused_in_one_line(workplace, capsys, command: str, kind: str):
    if kind == "without permission" and os.geteuid() == 0:
        pytest.skip("root may read everything")
    arguments, endings = COMMANDS[command]
    for ending in endings:
        if ending == "parquet":
            pytest.importorskip("pyarrow")
        name = bad_file(kind, ending)
        assert main([name if word == "?" else word for word in arguments]) == 2
        shown = name if kind != "zero in name" else r"a\x00b"
        assert shown in complaint(capsys)


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "-1", "0", "1e-320", "1e400"])
@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "fig4", "--stop-time"],
        ["run", "fig4", "--step"],
        ["run", "fig4", "--stop-time", "0.1", "--interval"],
        ["export", "fig4", "--step"],
        ["animate", "fig4", "--step"],
        ["animate", "fig4", "--stop-time"],
        ["verify", "file.csv", "--tolerance"],
    ],
)
def test_number_that_makes_no_sense_is_refused(workplace, capsys, arguments, number):
    *command, option = arguments
    if (option, number) in GOOD:
        pytest.skip("is one")
    assert main([*command, f"{option}={number}"]) == 2
    assert complaint(capsys)


@pytest.mark.parametrize("number", ["0", "-1", "99999999999999999999"])
@pytest.mark.parametrize("arguments", [["hosts", "--steps"], ["animate", "fig4", "--fps"]])
def test_count_that_makes_no_sense_is_refused(workplace, capsys, arguments, number):
    assert main([*arguments, number]) == 2
    assert complaint(capsys)
