"""What killed processes leave is told from what others still work on."""

from __future__ import annotations

import os
import signal
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from orchestrator.machine import disk
from orchestrator.machine.disk import hold_lock, process_folder, sealed
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


def marker(folder: str) -> str:
    return sealed({"folder": folder, "token": "0" * 32})


def test_folders_that_no_process_has_made_stay(tmp_path: Path, monkeypatch):
    """A temporary folder is everybody's, and names are free."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    precious = tmp_path / "precious"
    for folder in (precious, tmp_path / "auvfmu-mine", tmp_path / "auvfmu-copied"):
        folder.mkdir()
        (folder / "file").write_text("mine")
    (tmp_path / "auvfmu-copied" / ".auv-fmu.json").write_text(marker("auvfmu-first"))
    (tmp_path / "auvfmu-planted").symlink_to(precious)
    (precious / ".auv-fmu.json").write_text(marker("auvfmu-planted"))
    before = contents(tmp_path)
    disk._remove_left()
    assert contents(tmp_path) == before
    (tmp_path / "auvfmu-copied" / ".auv-fmu.json").write_text(marker("auvfmu-copied"))
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
