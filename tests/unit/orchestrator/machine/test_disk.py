"""Files, locks and temporary folders of processes that may be killed."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.machine import disk
from orchestrator.machine.disk import (
    LOCK,
    file_name,
    hold_lock,
    move_aside,
    plain_file_names,
    process_folder,
    sealed,
    unsealed,
)
from support.machine import contents, ended, eventually, forked


def test_a_lock_is_held_until_its_process_is_killed(tmp_path: Path):
    def work() -> None:
        with hold_lock(tmp_path):
            (tmp_path / "held").touch()
            signal.pause()

    pid = forked(work)
    assert eventually((tmp_path / "held").exists)
    with pytest.raises(BlockingIOError), hold_lock(tmp_path):
        pass
    os.kill(pid, signal.SIGKILL)
    ended(pid)
    with hold_lock(tmp_path):
        pass


def test_folders_without_a_marker_stay(tmp_path: Path, monkeypatch):
    """All programs share the folder for temporary files, and may use our names."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    precious = tmp_path / "precious"
    for folder in (precious, tmp_path / "auvfmu-mine", tmp_path / "auvfmu-copied"):
        folder.mkdir()
        (folder / "file").write_text("mine")
    (tmp_path / "auvfmu-copied" / ".auv-fmu.json").write_text("auvfmu-first")
    (tmp_path / "auvfmu-planted").symlink_to(precious)
    (precious / ".auv-fmu.json").write_text("auvfmu-planted")
    before = contents(tmp_path)
    disk._remove_left()
    assert contents(tmp_path) == before
    (tmp_path / "auvfmu-copied" / ".auv-fmu.json").write_text("auvfmu-copied")
    disk._remove_left()
    assert not (tmp_path / "auvfmu-copied").exists()


def test_temporary_folders_of_killed_processes_are_removed_by_the_next(tmp_path: Path, monkeypatch):
    # Keep a reference: otherwise a fork that drops the object removes the folder.
    own = disk._process_folder()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def work() -> None:
        disk._process_folder.cache_clear()
        (process_folder() / "unpacked").touch()
        os.kill(os.getpid(), signal.SIGKILL)

    assert ended(forked(work)) == -signal.SIGKILL
    [first] = tmp_path.iterdir()
    assert ended(forked(work)) == -signal.SIGKILL
    [second] = tmp_path.iterdir()
    assert second != first
    assert Path(own.name).is_dir()


def test_temporary_folders_end_with_their_processes_without_a_warning():
    """Forked processes end in another way."""
    script = (
        "from multiprocessing import get_context\n"
        "from orchestrator.machine.disk import process_folder\n"
        "def work(): print(process_folder(), flush=True)\n"
        "child = get_context('fork').Process(target=work)\n"
        "child.start(); child.join(); work()\n"
    )
    command = [sys.executable, "-X", "dev", "-W", "error", "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    folders = {*done.stdout.split()}
    assert len(folders) == 2 and not any(Path(folder).exists() for folder in folders)


def test_threads_share_one_temporary_folder(tmp_path: Path, monkeypatch):
    own = disk._process_folder()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def work() -> None:
        disk._process_folder.cache_clear()
        together = Barrier(8)

        def ask(_: int) -> Path:
            together.wait()
            return process_folder()

        with ThreadPoolExecutor(8) as pool:
            assert len({*pool.map(ask, range(8))}) == 1
        assert len([*tmp_path.iterdir()]) == 1

    assert ended(forked(work)) == 0
    assert Path(own.name).is_dir()


@pytest.mark.parametrize("content", [b"mine", b""])
def test_a_users_file_with_the_name_of_a_lock_stays(tmp_path: Path, content: bytes):
    (tmp_path / LOCK).write_bytes(content)
    with hold_lock(tmp_path), pytest.raises(BlockingIOError), hold_lock(tmp_path):
        pass
    assert not content or (tmp_path / LOCK).read_bytes() == content


def test_a_lock_that_cannot_be_removed_while_open_is_removed_later(tmp_path, monkeypatch):
    """As on Windows."""
    unlink, opened = Path.unlink, [True]

    def as_windows(path: Path, **options: bool) -> None:
        if opened and opened.pop():
            raise PermissionError(errno.EACCES, "in use", str(path))
        unlink(path, **options)

    monkeypatch.setattr(Path, "unlink", as_windows)
    with hold_lock(tmp_path):
        assert (tmp_path / LOCK).exists()
    assert not opened and not (tmp_path / LOCK).exists()


def test_no_lock_is_taken_through_a_link(tmp_path: Path):
    (tmp_path / "precious").touch()
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / LOCK).symlink_to("../precious")
    with pytest.raises(OSError, match="symbolic link"), hold_lock(tmp_path / "r"):
        pass
    assert (tmp_path / "precious").exists()
    assert (tmp_path / "r" / LOCK).is_symlink()


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS])
def test_without_locks_in_the_file_system_work_continues(tmp_path: Path, monkeypatch, number):
    def cannot(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", cannot)
    with hold_lock(tmp_path), hold_lock(tmp_path):
        pass


def test_moving_aside_replaces_nothing(tmp_path: Path):
    for text in ("first", "second"):
        (tmp_path / "a").write_text(text)
        move_aside(tmp_path / "a")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b").write_text("third")
    move_aside(tmp_path / "a")
    (tmp_path / "a").symlink_to("nowhere")
    move_aside(tmp_path / "a")
    assert contents(tmp_path) == {"a.~1~": b"first", "a.~2~": b"second", "a.~3~/b": b"third"}
    assert os.readlink(tmp_path / "a.~4~") == "nowhere"  # noqa: PTH115  # not its target


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=5,
)


@given(st.dictionaries(st.text().filter(lambda key: key != "sha256"), values))
def test_sealed_records_read_back(content):
    assert json.dumps(unsealed(sealed(content))) == json.dumps(content)


# Names of files

#: Words, signs of paths, and letters that some file systems take for others.
NAMES = st.text("aAbß.é/\\:*? -_", max_size=6) | st.sampled_from(["con", "LPT1.x", "..", "x" * 300])


@given(st.lists(NAMES, unique=True))
def test_every_name_gets_a_different_file_name_on_every_system(names):
    found = [file_name(name) for name in names]
    assert len(set(found)) == len(names)
    for name in found:
        assert not re.search(r'[/\\:*?"<>|\0]', name) and not name.startswith(".")
        assert name == name.strip() and not name.endswith(".") and 0 < len(name.encode()) < 200
        assert name.split(".")[0].lower() not in ("con", "lpt1")
    beside: list[str] = []
    for name in names:
        beside.append(file_name(name, beside))
    assert len({name.casefold() for name in beside}) == len(names)


@given(st.lists(NAMES), st.lists(NAMES))
def test_names_for_a_uri_are_plain_and_no_two_differ_in_case_only(names, taken):
    found = plain_file_names(names, *taken)
    assert len(found) == len(names) == len({name.lower() for name in found})
    assert {name.lower() for name in found}.isdisjoint(name.lower() for name in taken)
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]*", name) for name in found)
