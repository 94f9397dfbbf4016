"""Each branch, with fakes of the systems: they record calls and arguments.

`.ci/windows` runs the branches of Windows in wine. The branches of macOS were never run there.
"""

from __future__ import annotations

import ctypes
import errno
import os
import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from orchestrator.machine import operating_system


@pytest.fixture
def on(monkeypatch):
    """Let the module take this machine for another one."""

    def take_for(name: str) -> None:
        faked = SimpleNamespace(platform=name, maxsize=sys.maxsize)
        monkeypatch.setattr(operating_system, "sys", faked)

    return take_for


class Kernel:
    """Calls of Windows' kernel."""

    def __init__(self) -> None:
        self.ignores: list[bool] = []

    def SetConsoleCtrlHandler(self, handler, ignore):
        assert handler is None
        self.ignores.append(ignore)


@pytest.fixture
def kernel(on, monkeypatch) -> Kernel:
    faked = Kernel()
    monkeypatch.setattr(ctypes, "WinDLL", lambda name: faked, raising=False)
    monkeypatch.setattr(operating_system.time, "sleep", lambda _: None)
    on("win32")
    return faked


def test_processes_of_windows_inherit_that_they_ignore_ctrl_c(kernel: Kernel):
    with operating_system.without_interrupt():
        assert kernel.ignores == [True]
    assert kernel.ignores == [True, False]


def test_processes_of_linux_inherit_that_ctrl_c_is_blocked():
    with operating_system.without_interrupt():
        assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_limits_of_windows(on):
    on("linux")
    assert operating_system.can_isolate()
    assert operating_system.most_processes() > 10_000
    on("win32")
    assert not operating_system.can_isolate()
    # 64 handles at once, less the two of the pool and one of its own: Python refuses 62.
    assert operating_system.most_processes() == 61


def test_files_but_not_folders_are_flushed_on_windows(on, tmp_path: Path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda number: synced.append(os.fstat(number).st_ino))
    path = tmp_path / "file"
    path.write_text("text")
    on("win32")
    operating_system.sync_to_disk(tmp_path)
    operating_system.sync_to_disk(path)
    assert synced == [path.stat().st_ino]
    assert path.read_text() == "text"


def test_macos_flushes_the_drive_too(on, tmp_path: Path, monkeypatch):
    asked, synced, knows = [], [], True

    def fcntl(number, what):
        asked.append((os.fstat(number).st_ino, what))
        if not knows:
            raise OSError(errno.ENOTSUP, "not supported")

    faked = SimpleNamespace(fcntl=fcntl, F_FULLFSYNC=51)
    monkeypatch.setattr(operating_system, "import_module", lambda _: faked)
    monkeypatch.setattr(os, "fsync", lambda number: synced.append(os.fstat(number).st_ino))
    on("darwin")
    operating_system.sync_to_disk(tmp_path)
    assert asked == [(tmp_path.stat().st_ino, 51)] and not synced
    knows = False
    operating_system.sync_to_disk(tmp_path)
    assert synced == [tmp_path.stat().st_ino]


@pytest.mark.parametrize("system", ["linux", "win32"])
def test_renaming_replaces_nothing(on, tmp_path: Path, monkeypatch, system: str):
    """Windows refuses by itself, which is faked here."""
    rename = Path.rename

    def as_windows(path: Path, new: Path) -> Path:
        if new.exists():
            raise FileExistsError(errno.EEXIST, "there")
        return rename(path, new)

    monkeypatch.setattr(Path, "rename", as_windows)
    on(system)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").write_text("mine")
    (tmp_path / "file").write_text("file")
    (tmp_path / "taken").touch()
    for name in ("folder", "file"):
        with pytest.raises(FileExistsError):
            operating_system.rename_to_new(tmp_path / name, tmp_path / "taken")
        operating_system.rename_to_new(tmp_path / name, tmp_path / f"{name}.~1~")
    assert (tmp_path / "folder.~1~" / "mine").read_text() == "mine"
    assert (tmp_path / "file.~1~").read_text() == "file"
    assert not (tmp_path / "file").exists()


def test_modes_are_ignored_on_windows(on, tmp_path: Path):
    tmp_path.chmod(0o777)
    status = tmp_path.stat()
    assert operating_system.others_write(status) and operating_system.is_mine(status)
    others = os.stat_result((0o700, 1, 1, 1, os.geteuid() + 1, 0, 0, 0, 0, 0))
    assert not operating_system.is_mine(others)
    on("win32")
    assert not operating_system.others_write(status) and operating_system.is_mine(others)


def test_end_of_a_pipe_is_polled_on_windows(kernel: Kernel, monkeypatch):
    asked = []

    def peek(handle, size):
        asked.append((handle, size))
        if len(asked) == 3:
            raise BrokenPipeError

    faked = {
        "msvcrt": SimpleNamespace(get_osfhandle=lambda number: 100 + number),
        "_winapi": SimpleNamespace(PeekNamedPipe=peek),
    }
    monkeypatch.setattr(operating_system, "import_module", faked.__getitem__)
    operating_system.wait_for_end(7)
    assert asked == [(107, 0)] * 3


def test_end_of_a_pipe():
    reading, writing = os.pipe()
    os.close(writing)
    operating_system.wait_for_end(reading)
    os.close(reading)


def test_signals_do_not_wait_for_a_reader():
    reading, writing = os.pipe()
    operating_system.never_wait_for_pipe(writing)
    assert not os.get_blocking(writing)
    os.close(reading)
    os.close(writing)


def test_floating_point_functions_have_the_names_of_each_system(on, monkeypatch):
    library = SimpleNamespace(_fpreset="reset", fegetenv="get", fesetenv=lambda mode: mode)
    opened = []
    monkeypatch.setattr(ctypes, "PyDLL", lambda name: opened.append(name) or library)
    on("win32")
    assert operating_system.floating_point_calls()[:2] == ("reset", "get")
    on("darwin")
    monkeypatch.setattr(
        operating_system.ctypes,
        "c_char",
        SimpleNamespace(in_dll=lambda _, name: ctypes.c_int(len(name))),
    )
    operating_system.floating_point_calls()[0]()
    on("linux")
    assert operating_system.floating_point_calls()[0]().value == ctypes.c_void_p(-1).value
    assert opened == ["ucrtbase", None, None]
