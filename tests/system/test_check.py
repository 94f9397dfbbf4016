"""`auv-fmu check`: everything at once, and nothing is run."""

from __future__ import annotations

import shutil
from pathlib import Path
from zipfile import ZipFile

import fmpy
import pytest

from orchestrator.commands.main import main
from orchestrator.system.ssp import STRUCTURE

SCENARIO = """
title = "a mistake a line"
[wires]
"plant.tau" = "nobody.tau"
"plant.foo" = "controller.tau"
[parameters]
plant.m11 = "heavy"
plant.m99 = 3
controler.k_d = 3
"""


def lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """What was shown; nothing was said beside it."""
    out, err = capsys.readouterr()
    assert err == ""
    return str(out).splitlines()


def changed(archive: Path, *changes: tuple[str, str], without: str = "") -> Path:
    """An archive with other words in its description, or without one of its files."""
    path = Path(archive.name)
    with ZipFile(archive) as old, ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == STRUCTURE:
                for before, after in changes:
                    assert before.encode() in content
                    content = content.replace(before.encode(), after.encode(), 1)
            if not (without and name.endswith(without)):
                new.writestr(name, content)
    return path


@pytest.mark.parametrize("name", ["fig4", "auv.ssp", "MotionPlanner.fmu"])
def test_nothing_is_wrong_with_ours(dist, workplace, capsys, name):
    if "." in name:
        shutil.copy(dist / name, workplace)
    assert main(["check", name]) == 0
    assert lines(capsys) == [f"{name}: nothing is wrong with it"]


def test_all_mistakes_of_a_scenario_are_said(workplace, capsys):
    Path("mine.toml").write_text(SCENARIO)
    assert main(["check", "mine.toml"]) == 2
    shown = lines(capsys)
    assert len(shown) == 5
    assert all(line.startswith("problem: ") for line in shown)
    for word in ("nobody", "foo", "heavy", "m99", "controler"):
        assert sum(word in line for line in shown) == 1


def test_all_bad_entries_of_a_scenario_are_said(workplace, capsys):
    Path("mine.toml").write_text('titel = "x"\nstop_time = "long"\n')
    assert main(["check", "mine.toml"]) == 2
    assert len(lines(capsys)) == 2


def test_run_says_the_first_and_how_many_more(workplace, capsys):
    Path("mine.toml").write_text(SCENARIO)
    assert main(["run", "mine.toml"]) == 2
    out, err = capsys.readouterr()
    assert "nobody" in err and "4 more: see `auv-fmu check`" in err
    assert not out


def test_all_mistakes_of_an_archive_are_said(dist, workplace, capsys):
    path = changed(
        dist / "auv.ssp",
        ('endConnector="tau.u"', 'endConnector="tau.v"'),
        ('startElement="planner"', 'startElement="nobody"'),
        without="DisturbanceGenerator.fmu",
    )
    assert main(["check", str(path)]) == 2
    shown = "\n".join(lines(capsys))
    for word in ("tau.v", "nobody", "DisturbanceGenerator.fmu"):
        assert word in shown


def test_missing_binary_is_said(dist, workplace, capsys):
    with ZipFile(dist / "MotionPlanner.fmu") as old, ZipFile("odd.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name.replace(fmpy.platform, "amiga32"), old.read(name))
    assert main(["check", "odd.fmu"]) == 2
    [line] = lines(capsys)
    assert f"for this machine, {fmpy.platform}" in line and "amiga32" in line


def test_archive_may_leave_the_stop_time_open(dist, workplace, capsys):
    path = changed(dist / "auv.ssp", (' stopTime="100.0"', ""))
    assert main(["check", str(path)]) == 0
    assert "--stop-time" in lines(capsys)[0]


@pytest.mark.parametrize("ending", ["fmu", "ssp", "toml"])
@pytest.mark.parametrize("content", [None, b"", b"\xff\x00PK"])
def test_what_cannot_be_read_is_one_problem(workplace, capsys, ending, content):
    path = Path(f"bad.{ending}")
    if content is not None:
        path.write_bytes(content)
    assert main(["check", str(path)]) in ((0, 2) if ending == "toml" and content == b"" else (2,))
    [line] = lines(capsys)
    assert path.name in line


@pytest.mark.parametrize("ending", ["fmu", "ssp"])
def test_a_pointer_of_git_lfs_is_called_so(workplace, capsys, ending):
    Path(f"m.{ending}").write_text(
        "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n"
    )
    assert main(["check", f"m.{ending}"]) == 2
    [line] = lines(capsys)
    assert f"m.{ending}: is a pointer of Git LFS" in line and "`git lfs pull`" in line


def test_an_archive_without_a_description_is_no_fmu(workplace, capsys):
    with ZipFile("m.fmu", "w") as archive:
        archive.writestr("m/modelDescription.xml", "<fmiModelDescription/>")
    assert main(["check", "m.fmu"]) == 2
    [line] = lines(capsys)
    assert line.endswith("not a readable FMU: it holds no modelDescription.xml")
