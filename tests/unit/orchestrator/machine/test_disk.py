"""Files, locks and temporary folders of processes that may be killed."""

from __future__ import annotations

import errno
import json
import os
import signal
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.machine import disk
from orchestrator.machine.disk import LOCK, hold_lock, move_aside, process_folder, sealed, unsealed
from support.machine import contents, ended, eventually, forked


def test_what_a_process_has_claimed_is_kept_from_others_until_it_is_killed(tmp_path: Path):
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


def test_folders_that_no_process_has_made_stay(tmp_path: Path, monkeypatch):
    """A temporary folder is everybody's, and names are free."""
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


def test_temporary_folders_of_killed_processes_go_with_the_next(tmp_path: Path, monkeypatch):
    # Held, or a fork that forgets it would remove that of this process.
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
def test_a_file_of_the_users_that_is_called_like_a_lock_stays(tmp_path: Path, content: bytes):
    (tmp_path / LOCK).write_bytes(content)
    with hold_lock(tmp_path), pytest.raises(BlockingIOError), hold_lock(tmp_path):
        pass
    assert not content or (tmp_path / LOCK).read_bytes() == content


def test_a_lock_that_cannot_be_removed_while_it_is_open_is_removed_then(tmp_path, monkeypatch):
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


def test_no_lock_is_taken_by_a_link(tmp_path: Path):
    (tmp_path / "precious").touch()
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / LOCK).symlink_to("../precious")
    with pytest.raises(OSError, match="symbolic link"), hold_lock(tmp_path / "r"):
        pass
    assert (tmp_path / "precious").exists()
    assert (tmp_path / "r" / LOCK).is_symlink()


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS])
def test_where_there_are_no_locks_nobody_is_kept_out(tmp_path: Path, monkeypatch, number):
    def cannot(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", cannot)
    with hold_lock(tmp_path), hold_lock(tmp_path):
        pass


def test_what_is_moved_aside_replaces_nothing(tmp_path: Path):
    for text in ("first", "second"):
        (tmp_path / "a").write_text(text)
        move_aside(tmp_path / "a")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b").write_text("third")
    move_aside(tmp_path / "a")
    (tmp_path / "a").symlink_to("nowhere")
    move_aside(tmp_path / "a")
    assert contents(tmp_path) == {"a.~1~": b"first", "a.~2~": b"second", "a.~3~/b": b"third"}
    assert os.readlink(tmp_path / "a.~4~") == "nowhere"  # noqa: PTH115  # not what it leads to


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=5,
)


@given(st.dictionaries(st.text().filter(lambda key: key != "sha256"), values))
def test_sealed_records_read_back(content):
    assert json.dumps(unsealed(sealed(content))) == json.dumps(content)
