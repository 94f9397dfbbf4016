"""A folder of results changes all at once or not at all, and the files of the user stay."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from shutil import rmtree

import pytest

from orchestrator.machine.disk import sealed
from orchestrator.machine.errors import InputError
from orchestrator.runs.folder import (
    LEDGER,
    RECORD,
    Ledger,
    Taken,
    is_changed,
    locate,
    locked_folder,
    open_ledger,
    replace_files,
)
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
    """Undo the publication of a killed process, as the next command does."""
    with open_ledger(folder):
        pass


def files(folder: Path) -> set[str]:
    return contents(folder).keys()


def seen(folder: Path) -> dict[str, bytes]:
    """Files of the result for commands that only read; empty without a record."""
    record = locate(folder / RECORD)
    names = json.loads(record.read_text())["files"] if record.is_file() else []
    return {name: locate(folder / name).read_bytes() for name in names}


def test_earlier_files_of_the_program_are_removed_and_other_files_stay(tmp_path: Path):
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


def test_a_new_folder_is_removed_after_an_error(tmp_path: Path):
    with pytest.raises(InputError, match="no scenario"), replace_files(tmp_path / "r"):
        raise InputError("no scenario")
    assert not (tmp_path / "r").exists()


def test_the_next_run_removes_the_files_of_a_killed_one(tmp_path: Path):
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


def test_a_failing_disk_keeps_the_earlier_files_and_new_rows(tmp_path: Path):
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
    """As on a server that reports a full disk only at the end."""
    write(tmp_path / "r", "a.csv", text="old")
    before = contents(tmp_path)

    def fail(*_: object) -> None:
        monkeypatch.undo()
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, fail)
    with pytest.raises(InputError, match=rf"{os.strerror(number)}; what was written is in"):
        write(tmp_path / "r", "a.csv", keep=lambda: True)
    # Without a record, which states that the run was completed.
    assert contents(tmp_path) == before | {"r/incomplete/a.csv": b"new"}


def test_a_file_system_without_fsync_is_written_all_the_same(tmp_path: Path, monkeypatch):
    def cannot(_: int) -> None:
        raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr(os, "fsync", cannot)
    write(tmp_path / "r", "a.csv")
    assert (tmp_path / "r" / "a.csv").read_text() == "new"


def test_everything_is_on_the_disk_before_it_counts(tmp_path: Path, monkeypatch):
    """After a power cut a name may lead to an empty file if the contents were not written first."""
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
    # Ledgers: the first, the one with the moving files, and the one that makes them count.
    _, moving, counting = (i for i, name in enumerate(names) if name == ("replace", LEDGER))
    assert {("fsync", name) for name in ("a.csv", "b.csv", "below", RECORD)} < set(names[:moving])
    assert names[moving + 1] == ("fsync", "r")
    moved = [name for call, name in names[moving + 1 : counting] if call == "replace"]
    assert moved == ["a.csv", "b.csv", RECORD]
    last = names.index(("replace", RECORD))
    assert {("fsync", "r"), ("fsync", "below")} < {*names[last:counting]}


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
        # All files in a record exist, also during a publication.
        assert seen(folder) in (contents(old), contents(new)), n
        settle(folder)
        visible = {k: v for k, v in contents(folder).items() if not k.startswith(".")}
        assert visible in (contents(old), contents(new)), n
        write_new(folder)
        assert contents(folder) == contents(new), n
        n += 1
    assert n > 20


@pytest.mark.slow
def test_killed_again_while_the_next_command_undoes_it(tmp_path: Path):
    old, folder = tmp_path / "old", tmp_path / "r"
    write(old, "a.csv", "old.png", text="old")

    def begin() -> None:
        rmtree(folder, ignore_errors=True)
        write(folder, "a.csv", "old.png", text="old")
        # All new files have been moved, but do not count yet.
        assert killed_at(7, lambda: write(folder, "a.csv", "new.png"), ["replace"])
        assert (folder / "a.csv").read_text() == "new"
        assert locate(folder / "a.csv").read_text() == "old"
        assert not locate(folder / "new.png").exists()
        assert not is_changed(folder / "a.csv")

    n = 0
    while True:
        begin()
        if not killed_at(n, lambda: settle(folder)):
            break
        settle(folder)
        visible = {k: v for k, v in contents(folder).items() if not k.startswith(".")}
        assert visible == contents(old), n
        n += 1
    assert n > 4


@pytest.mark.parametrize("name", ["../precious", "/etc/hostname", "notes.txt"])
def test_a_record_without_a_ledger_owns_no_file(tmp_path: Path, name):
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "notes.txt").write_text("mine")
    (tmp_path / "r" / RECORD).write_text(json.dumps({"files": [name]}))
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"run\.json is not a file that auv-fmu wrote"):
        write(tmp_path / "r", "a.csv")
    assert contents(tmp_path) == before


def test_a_failed_result_is_kept_until_the_next_complete_one(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="whole")
    write(tmp_path / "r", "a.csv", "below/b.csv", text="half", failure="interrupted")
    assert (tmp_path / "r" / "a.csv").read_text() == "whole"
    assert (tmp_path / "r" / "incomplete" / "a.csv").read_text() == "half"
    write(tmp_path / "r", "a.csv")
    assert files(tmp_path / "r") == {"a.csv", RECORD}
    assert not (tmp_path / "r" / "incomplete").exists()


def test_a_link_named_incomplete_is_not_followed(tmp_path: Path):
    """Although it leads to the files of a run."""
    write(tmp_path / "other", "a.csv")
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "incomplete").symlink_to(tmp_path / "other")
    write(tmp_path / "r", "a.csv", text="whole")
    before = contents(tmp_path)
    write(tmp_path / "r", "a.csv", text="half", failure="interrupted")
    after = contents(tmp_path)
    assert {name: after[name] for name in before} == before
    assert after["r/incomplete-2/a.csv"] == b"half"


def test_rows_are_kept_if_the_staging_folder_cannot_be_renamed(tmp_path: Path, monkeypatch):
    write(tmp_path / "r", "a.csv", text="whole")

    def fail(*_: object) -> None:
        monkeypatch.undo()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "rename", fail)
    with pytest.raises(InputError, match=r"what was written is in .*/incomplete;"):
        write(tmp_path / "r", "a.csv", text="half", failure="interrupted", keep=lambda: True)
    assert (tmp_path / "r" / "incomplete" / "a.csv").read_text() == "half"


def test_a_failed_result_replaces_a_failed_one(tmp_path: Path):
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
    put(tmp_path / "r", "new", "z.csv", force=True)
    assert (tmp_path / "r" / "z.csv.~1~").is_dir()


def test_an_export_does_not_replace_a_result(tmp_path: Path):
    write(tmp_path / "r", "a.csv", text="whole")
    with replace_files(tmp_path / "r") as unfinished:
        (unfinished / "fig4.ssp").write_text("exported")
    assert files(tmp_path / "r") == {"a.csv", RECORD, "fig4.ssp"}


def test_new_folders_that_stay_empty_go_again(tmp_path):
    new, below = tmp_path / "new", tmp_path / "new" / "below"
    with locked_folder(below):
        rmtree(below)
    assert not new.exists()
    with pytest.raises(InputError, match="long"), locked_folder(below / ("x" * 300)):
        pass
    assert not new.exists()
    with locked_folder(below):
        (new / "kept").touch()
    assert [*new.iterdir()] == [new / "kept"]


def put(folder: Path, text: str, *names: str, force: bool = False) -> Ledger:
    ledger = Ledger(folder, force)
    with ledger.changing() as unfinished:
        for name in names:
            (unfinished / name).parent.mkdir(parents=True, exist_ok=True)
            (unfinished / name).write_text(text)
    return ledger


def test_unchanged_files_are_replaced_and_changed_files_are_not(tmp_path: Path):
    put(tmp_path, "first", "a", "below/b")
    put(tmp_path, "second", "a", "below/b")
    assert contents(tmp_path) == {"a": b"second", "below/b": b"second"}
    (tmp_path / "below/b").write_text("mine")
    assert is_changed(tmp_path / "below/b")
    assert not is_changed(tmp_path / "a")
    before = contents(tmp_path)
    with pytest.raises(Taken, match=r"below/b is not a file that auv-fmu wrote, or was changed"):
        put(tmp_path, "third", "a", "below/b")
    assert contents(tmp_path) == before
    put(tmp_path, "third", "a", "below/b", force=True)
    assert contents(tmp_path) == {"a": b"third", "below/b": b"third", "below/b.~1~": b"mine"}


def test_changed_files_are_not_removed(tmp_path: Path):
    ledger = put(tmp_path, "ours", "a", "b", "below/c")
    (tmp_path / "a").write_text("mine")
    ledger.remove(["a", "b", "below/c"])
    assert contents(tmp_path) == {"a": b"mine"}
    assert not (tmp_path / LEDGER).exists()


@pytest.mark.parametrize("name", ["a", "below/a"])
def test_links_are_not_followed(tmp_path: Path, name):
    """To a file or to a folder, although they lead to the written file."""
    folder, elsewhere = tmp_path / "r", tmp_path / "elsewhere"
    folder.mkdir()
    put(folder, "ours", name)
    (folder / Path(name).parts[0]).rename(elsewhere)
    (folder / Path(name).parts[0]).symlink_to(elsewhere)
    before = contents(tmp_path)
    with pytest.raises(Taken):
        put(folder, "new", name)
    Ledger(folder).remove([name])
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    "content",
    ["mine", "{}", "[]", '{"identity": "0", "files": {}}', sealed({"identity": "x"})],
)
def test_an_invalid_ledger_is_refused_or_moved_aside(tmp_path: Path, content):
    (tmp_path / LEDGER).write_text(content)
    with pytest.raises(Taken, match="its own files are unknown"):
        Ledger(tmp_path)
    Ledger(tmp_path, force=True)
    assert (tmp_path / f"{LEDGER}.~1~").read_text() == content


@pytest.mark.parametrize("name", ["../precious", "/etc/hostname", "below/../../precious"])
@pytest.mark.parametrize("entry", ["files", "moving"])
def test_a_forged_ledger_does_not_lead_out_of_the_folder(tmp_path: Path, name, entry):
    content = {"identity": "0" * 32, "files": {}, "moving": {}, entry: {name: "0" * 64}}
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / LEDGER).write_text(sealed(content))
    with pytest.raises(Taken, match="damaged or not from auv-fmu"):
        Ledger(tmp_path / "r")


@pytest.mark.parametrize("link", ["", ".earlier", ".earlier/below", ".earlier/below/key"])
def test_a_forged_ledger_moves_nothing_from_elsewhere(tmp_path: Path, link):
    """A folder of another person may contain a ledger, and links to files of the user's."""
    folder, elsewhere = tmp_path / "r", tmp_path / "elsewhere"
    staging, path = folder / (".auv-fmu-" + "0" * 32), Path(".earlier/below/key")
    (elsewhere / path.parent).mkdir(parents=True)
    (elsewhere / path).write_text("mine")
    (staging / link).parent.mkdir(parents=True)
    (staging / link).symlink_to(elsewhere / link)
    content = {"identity": "0" * 32, "files": {}, "moving": {"below/key": "0" * 64}}
    (folder / LEDGER).write_text(sealed(content))
    with suppress(OSError):
        put(folder, "ours", "a")
    assert (elsewhere / path).read_text() == "mine"
    assert not os.path.lexists(folder / "below" / "key")


@pytest.mark.parametrize("link", ["", "below"])
def test_a_forged_ledger_moves_nothing_elsewhere(tmp_path: Path, link):
    folder, elsewhere = tmp_path / "r", tmp_path / "elsewhere"
    staging = folder / (".auv-fmu-" + "0" * 32)
    (folder / "below").mkdir(parents=True)
    (folder / "below" / "key").write_text("mine")
    (elsewhere / link).mkdir(parents=True)
    (staging / link).parent.mkdir(parents=True, exist_ok=True)
    (staging / link).symlink_to(elsewhere / link)
    moving = {"below/key": sha256(b"mine").hexdigest()}
    (folder / LEDGER).write_text(sealed({"identity": "0" * 32, "files": {}, "moving": moving}))
    with suppress(OSError):
        put(folder, "ours", "a")
    assert (folder / "below" / "key").read_text() == "mine"
    assert not list(elsewhere.rglob("key"))


def test_files_of_the_user_stay_if_they_are_in_the_way_of_earlier_ones(tmp_path: Path):
    put(tmp_path, "old", "a", "below/b")
    # The new files have been moved, but do not count yet.
    assert killed_at(5, lambda: put(tmp_path, "new", "a", "below/b"), ["replace"])
    (tmp_path / "a").write_text("mine")
    rmtree(tmp_path / "below")
    (tmp_path / "below").symlink_to("nowhere")
    before = contents(tmp_path)
    with pytest.raises(Taken, match="/a is not a file that auv-fmu wrote"):
        settle(tmp_path)
    assert contents(tmp_path) == before
    with open_ledger(tmp_path, force=True):
        pass
    found = {k: v for k, v in contents(tmp_path).items() if not k.startswith(".")}
    assert found == {"a": b"old", "a.~1~": b"mine", "below/b": b"old"}
    assert (tmp_path / "below.~1~").is_symlink()


def test_no_link_is_written_through(tmp_path: Path):
    """The author of a forged ledger knows its token."""
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "r").mkdir()
    content = {"identity": "0" * 32, "files": {}, "moving": {}}
    (tmp_path / "r" / LEDGER).write_text(sealed(content))
    (tmp_path / "r" / (".auv-fmu-" + "0" * 32 + ".json")).symlink_to("../precious")
    put(tmp_path / "r", "ours", "a")
    assert (tmp_path / "precious").read_text() == "mine"
    assert (tmp_path / "r" / "a").read_text() == "ours"


@pytest.mark.parametrize("when", range(10))
@pytest.mark.parametrize("kept", [["a", RECORD], ["a", "b", "below/c", "new", RECORD]])
def test_files_that_cannot_take_their_places_leave_all_as_it_was(tmp_path, monkeypatch, kept, when):
    """Whichever rename fails; the next publication succeeds."""
    put(tmp_path, "first", "a", "b", "below/c", RECORD)
    before, replace, calls = contents(tmp_path), Path.replace, iter(range(99))

    def failing(path: Path, target: Path) -> Path:
        if target.name != LEDGER and next(calls) == when:
            raise PermissionError(1, "Operation not permitted", str(path))
        return replace(path, target)

    def publish(text: str) -> None:
        ledger = Ledger(tmp_path)
        with ledger.writing() as unfinished:
            for name in kept:
                (unfinished / name).parent.mkdir(exist_ok=True)
                (unfinished / name).write_text(text)
            ledger.publish(["a", "b", "below/c", RECORD])

    monkeypatch.setattr(Path, "replace", failing)
    with suppress(PermissionError):
        publish("second")
        assert next(calls) <= when
    monkeypatch.setattr(Path, "replace", replace)
    assert contents(tmp_path) in (before, dict.fromkeys(kept, b"second"))
    assert not list(tmp_path.glob(".auv-fmu-*"))
    publish("third")
    assert contents(tmp_path) == dict.fromkeys(kept, b"third")


def test_a_huge_ledger_is_not_read(tmp_path: Path):
    (tmp_path / "a").write_text("mine")
    with (tmp_path / LEDGER).open("wb") as file:
        file.truncate(2**40)
    assert is_changed(tmp_path / "a")
    with pytest.raises(Taken, match="damaged or not from auv-fmu"):
        Ledger(tmp_path)


@pytest.mark.slow
def test_no_bit_of_a_ledger_is_changed_unseen(tmp_path: Path):
    put(tmp_path, "ours", "a")
    text = (tmp_path / LEDGER).read_bytes()
    for bit in range(8 * len(text)):
        changed = bytearray(text)
        changed[bit // 8] ^= 1 << bit % 8
        (tmp_path / LEDGER).write_bytes(changed)
        with pytest.raises(Taken):
            Ledger(tmp_path)
