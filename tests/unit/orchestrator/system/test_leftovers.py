"""What killed processes leave is told from what others still work on."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from orchestrator.system import leftovers
from orchestrator.system.leftovers import claimed, created, process_folder, remove_left
from support.machine import ended, eventually, forked


def hold(path: Path) -> int:
    """A process that works on a file until it is killed."""

    def work() -> None:
        with claimed(path):
            path.with_suffix(".held").touch()
            signal.pause()

    pid = forked(work)
    assert eventually(path.with_suffix(".held").exists)
    return pid


def test_what_another_process_holds_stays_until_it_is_killed(tmp_path: Path):
    held, left, folder = (tmp_path / f".partial-{name}" for name in ("a", "b", "c"))
    held.write_text("half")
    left.write_text("half")
    (folder / "deep").mkdir(parents=True)
    pid = hold(held)
    remove_left(tmp_path, ".partial-[abc]")
    assert held.exists()
    assert not left.exists()
    assert not folder.exists()
    with pytest.raises(BlockingIOError), claimed(held):
        pass
    os.kill(pid, signal.SIGKILL)
    ended(pid)
    remove_left(tmp_path, ".partial-[abc]")
    assert not held.exists()


def test_a_new_file_is_not_taken_for_left(tmp_path: Path):
    """Others clean up at any moment, also between making a file and locking it."""

    def clean() -> None:
        while True:
            remove_left(tmp_path, ".partial-*")

    pid = forked(clean)
    try:
        for i in range(300):
            path = tmp_path / f".partial-{i}"
            with created(path):
                assert path.exists()
    finally:
        os.kill(pid, signal.SIGKILL)
        ended(pid)


def test_a_link_leads_nowhere(tmp_path: Path):
    """A temporary folder is everybody's."""
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "file").write_text("mine")
    (tmp_path / "auvfmu-planted").symlink_to(precious)
    remove_left(tmp_path, "auvfmu-*")
    assert (precious / "file").read_text() == "mine"


def test_temporary_folders_of_killed_processes_go_with_the_next(tmp_path: Path, monkeypatch):
    # Held, or a fork that forgets it would remove that of this process.
    own = leftovers._process_folder()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def work() -> None:
        leftovers._process_folder.cache_clear()
        (process_folder() / "unpacked").touch()
        os.kill(os.getpid(), signal.SIGKILL)

    assert ended(forked(work)) == -signal.SIGKILL
    [first] = tmp_path.iterdir()
    assert ended(forked(work)) == -signal.SIGKILL
    [second] = tmp_path.iterdir()
    assert second != first
    assert Path(own.name).is_dir()


def test_a_folder_that_is_taken_for_left_before_it_is_locked_is_not_used(monkeypatch):
    """Processes that start at the same time remove what they find of each other unlocked."""
    made = []

    def taken(**how: object) -> TemporaryDirectory[str]:
        folder = TemporaryDirectory(**how)
        if not made:
            shutil.rmtree(folder.name)
        made.append(folder)
        return folder

    monkeypatch.setattr(leftovers, "TemporaryDirectory", taken)
    # Not the folder of this process, which has one.
    folder = leftovers._process_folder.__wrapped__()
    assert Path(folder.name).is_dir()
    assert len(made) == 2
