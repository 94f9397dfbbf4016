"""A folder of results changes all at once, or not at all."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from shutil import rmtree

import pytest

from orchestrator.machine.errors import InputError
from orchestrator.machine.ledger import LEDGER, RECORD, locate
from orchestrator.runs.folder import make_folder, open_ledger, replace_files
from support.machine import contents, ended, forked, killed_at


def write(
    folder: Path,
    *names: str,
    text: str = "new",
    failure: str | None = None,
    keep: Callable[[], bool] = lambda: False,
) -> None:
    with replace_files(folder, keep=keep) as unfinished:
        for name in names:
            (unfinished / name).parent.mkdir(parents=True, exist_ok=True)
            (unfinished / name).write_text(text)
        (unfinished / RECORD).write_text(
            json.dumps({"files": [*names, RECORD], "failure": failure})
        )


def write_half(
    folder: Path, error: BaseException, keep: Callable[[], bool] = lambda: False
) -> None:
    with replace_files(folder, keep=keep) as unfinished:
        (unfinished / "a.csv").write_text("rows so far")
        raise error


def settle(folder: Path) -> None:
    """Go on with what a killed process has begun, as the next command does."""
    with open_ledger(folder):
        pass


def files(folder: Path) -> set[str]:
    return contents(folder).keys()


def seen(folder: Path) -> dict[str, bytes]:
    """The result as the commands see it that only read; empty, where there is no record."""
    record = locate(folder / RECORD)
    names = json.loads(record.read_text())["files"] if record.is_file() else []
    return {name: locate(folder / name).read_bytes() for name in names}


def test_earlier_files_go_and_those_of_others_stay(tmp_path: Path):
    write(tmp_path / "r", "a.csv", "old.png", "below/b.csv", text="old")
    (tmp_path / "r" / "notes.txt").write_text("mine")
    write(tmp_path / "r", "a.csv", "new.png")
    assert files(tmp_path / "r") == {"a.csv", "new.png", RECORD, "notes.txt"}
    assert (tmp_path / "r" / "a.csv").read_text() == "new"
    assert not (tmp_path / "r" / "below").exists()


def test_after_an_exception_everything_is_as_it_was(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="old")
    with pytest.raises(RuntimeError):
        write_half(tmp_path / "r", RuntimeError())
    assert files(tmp_path / "r") == {"a.csv", RECORD}
    assert (tmp_path / "r" / "a.csv").read_text() == "old"


def test_a_folder_that_was_made_for_nothing_goes(tmp_path: Path):
    with pytest.raises(InputError, match="no scenario"), replace_files(tmp_path / "r"):
        raise InputError("no scenario")
    assert not (tmp_path / "r").exists()


def test_what_a_killed_run_has_left_goes_with_the_next(tmp_path: Path):
    def killed() -> None:
        with replace_files(tmp_path / "r") as unfinished:
            (unfinished / "result.csv").write_text("half")
            os.kill(os.getpid(), signal.SIGKILL)

    assert ended(forked(killed)) == -signal.SIGKILL
    [left] = files(tmp_path / "r")
    assert left.endswith("/result.csv")
    write(tmp_path / "r", "a.csv")
    assert files(tmp_path / "r") == {"a.csv", RECORD}


def test_second_run_into_the_same_folder_is_refused(tmp_path: Path):
    other = (
        "from pathlib import Path\n"
        "from orchestrator.runs.folder import replace_files\n"
        f"with replace_files(Path({str(tmp_path / 'r')!r})): print('in', flush=True); input()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-P", "-c", other],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "in\n"
        with pytest.raises(InputError, match="another run is writing into"):
            write(tmp_path / "r", "a.csv")
        process.stdin.write("\n")
    write(tmp_path / "r", "a.csv")


def test_a_failing_disk_keeps_what_was_there_and_what_is_worth_it(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="old")
    before = contents(tmp_path)
    full = OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(InputError, match="No space left on device; choose another place"):
        write_half(tmp_path / "r", full)
    assert contents(tmp_path) == before
    for name in ("incomplete", "incomplete-2"):
        with pytest.raises(InputError, match=f"what was written is in .*/{name};"):
            write_half(tmp_path / "r", full, keep=lambda: True)
        before[f"r/{name}/a.csv"] = b"rows so far"
        assert contents(tmp_path) == before


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, errno.EXDEV, errno.EDQUOT])
def test_a_disk_that_fails_at_the_last_moment(tmp_path: Path, monkeypatch, call, number):
    """As a server does that takes everything and says only then that it cannot keep it."""
    write(tmp_path / "r", "a.csv", text="old")
    before = contents(tmp_path)

    def fail(*_: object) -> None:
        monkeypatch.undo()
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, fail)
    with pytest.raises(InputError, match=rf"{os.strerror(number)}; what was written is in"):
        write(tmp_path / "r", "a.csv", keep=lambda: True)
    # Without a record that says that it came to its end.
    assert contents(tmp_path) == before | {"r/incomplete/a.csv": b"new"}


def test_a_file_system_without_fsync_is_written_all_the_same(tmp_path: Path, monkeypatch):
    def cannot(_: int) -> None:
        raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr(os, "fsync", cannot)
    write(tmp_path / "r", "a.csv")
    assert (tmp_path / "r" / "a.csv").read_text() == "new"


def test_everything_is_on_the_disk_before_it_counts(tmp_path: Path, monkeypatch):
    """After a power cut a name may lead to an empty file, if the contents were not there first."""
    calls: list[tuple[str, str]] = []
    fsync, replace = os.fsync, os.replace

    def recorded_fsync(descriptor: int) -> None:
        calls.append(("fsync", str(Path(f"/proc/self/fd/{descriptor}").readlink())))
        fsync(descriptor)

    def recorded_replace(source: Path, target: Path) -> None:
        calls.append(("replace", Path(target).name))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", recorded_fsync)
    monkeypatch.setattr(os, "replace", recorded_replace)
    write(tmp_path / "r", "a.csv", "below/b.csv")
    names = [(call, Path(path).name) for call, path in calls]
    # The first new ledger is the one that says that the files take their places.
    said = names.index(("replace", LEDGER))
    assert {("fsync", name) for name in ("a.csv", "b.csv", "below", RECORD)} < set(names[:said])
    assert names[said + 1] == ("fsync", "r")
    moved = [name for call, name in names[said + 1 :] if call == "replace"]
    assert moved == ["a.csv", "b.csv", RECORD, LEDGER]


@pytest.mark.slow
def test_killed_at_any_moment_the_folder_holds_the_old_result_or_the_new_one(tmp_path: Path):
    old, new, folder = tmp_path / "old", tmp_path / "new", tmp_path / "r"

    def write_old(to: Path) -> None:
        write(to, "a.csv", "old.png", "below/deep/b.csv", text="old")

    def write_new(to: Path) -> None:
        write(to, "a.csv", "new.png", "below/c.csv")

    write_old(old)
    write_new(new)
    n = 0
    while True:
        rmtree(folder, ignore_errors=True)
        write_old(folder)
        if not killed_at(n, lambda: write_new(folder)):
            break
        # A record says that all that it names is there, also while files take their places.
        assert seen(folder) in (contents(old), contents(new)), n
        settle(folder)
        visible = {k: v for k, v in contents(folder).items() if not k.startswith(".")}
        assert visible in (contents(old), contents(new)), n
        write_new(folder)
        assert contents(folder) == contents(new), n
        n += 1
    assert n > 20


@pytest.mark.slow
def test_killed_again_while_the_next_command_goes_on_with_it(tmp_path: Path):
    new, folder = tmp_path / "new", tmp_path / "r"
    write(new, "a.csv", "new.png")

    def begin() -> None:
        rmtree(folder, ignore_errors=True)
        write(folder, "a.csv", "old.png", text="old")
        # Just before the first file is moved.
        assert killed_at(1, lambda: write(folder, "a.csv", "new.png"), ["replace"])
        assert (folder / "a.csv").read_text() == "old"
        assert locate(folder / "a.csv").read_text() == "new"

    n = 0
    while True:
        begin()
        if not killed_at(n, lambda: settle(folder)):
            break
        settle(folder)
        assert contents(folder) == contents(new), n
        n += 1
    assert n > 4


@pytest.mark.parametrize("name", ["../precious", "/etc/hostname", "notes.txt"])
def test_somebody_elses_record_proves_nothing(tmp_path: Path, name):
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "notes.txt").write_text("mine")
    (tmp_path / "r" / RECORD).write_text(json.dumps({"files": [name]}))
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"run\.json is not a file that auv-fmu wrote"):
        write(tmp_path / "r", "a.csv")
    assert contents(tmp_path) == before


def test_a_run_that_came_to_no_end_stands_beside_a_whole_one_until_the_next(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="whole")
    write(tmp_path / "r", "a.csv", "below/b.csv", text="half", failure="interrupted")
    assert (tmp_path / "r" / "a.csv").read_text() == "whole"
    assert (tmp_path / "r" / "incomplete" / "a.csv").read_text() == "half"
    write(tmp_path / "r", "a.csv")
    assert files(tmp_path / "r") == {"a.csv", RECORD}
    assert not (tmp_path / "r" / "incomplete").exists()


def test_a_link_called_incomplete_leads_nowhere(tmp_path: Path):
    """Though what is there was written by a run."""
    write(tmp_path / "other", "a.csv")
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "incomplete").symlink_to(tmp_path / "other")
    write(tmp_path / "r", "a.csv", text="whole")
    before = contents(tmp_path)
    write(tmp_path / "r", "a.csv", text="half", failure="interrupted")
    after = contents(tmp_path)
    assert {name: after[name] for name in before} == before
    assert after["r/incomplete-2/a.csv"] == b"half"


def test_rows_are_kept_that_cannot_go_beside_a_whole_result(tmp_path: Path, monkeypatch):
    write(tmp_path / "r", "a.csv", text="whole")
    replace = os.replace

    def fail(source: Path, target: Path) -> None:
        if Path(target).parent.name == "incomplete":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(InputError, match=r"what was written is in .*/incomplete-2;"):
        write(tmp_path / "r", "a.csv", text="half", failure="interrupted", keep=lambda: True)
    assert (tmp_path / "r" / "incomplete-2" / "a.csv").read_text() == "half"


def test_a_run_that_came_to_no_end_takes_the_place_of_another_such(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="half", failure="interrupted")
    write(tmp_path / "r", "a.csv", failure="stopped")
    assert (tmp_path / "r" / "a.csv").read_text() == "new"


def test_a_folder_in_the_way_changes_nothing(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="old")
    (tmp_path / "r" / "z.csv").mkdir()
    with pytest.raises(InputError, match=r"z\.csv is a folder"):
        write(tmp_path / "r", "a.csv", "z.csv")
    assert (tmp_path / "r" / "a.csv").read_text() == "old"
    assert (tmp_path / "r" / RECORD).is_file()


def test_what_is_no_result_takes_the_place_of_none(tmp_path: Path):
    """An export into the folder of a run."""
    write(tmp_path / "r", "a.csv", text="whole")
    with replace_files(tmp_path / "r") as unfinished:
        (unfinished / "fig4.ssp").write_text("exported")
    assert files(tmp_path / "r") == {"a.csv", RECORD, "fig4.ssp"}


def test_new_folders_that_stay_empty_go_again(tmp_path):
    new, below = tmp_path / "new", tmp_path / "new" / "below"
    with make_folder(below):
        below.rmdir()
    assert not new.exists()
    with pytest.raises(OSError, match="long"), make_folder(below / ("x" * 300)):
        pass
    assert not new.exists()
    with make_folder(below):
        (new / "kept").touch()
    assert [*new.iterdir()] == [new / "kept"]
