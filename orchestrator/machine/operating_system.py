"""Differences between operating systems: only this module and `compilers` test which one runs.

All branches for Linux are tested, the ones for Windows under wine, and for macOS with fakes only.
"""

from __future__ import annotations

import ctypes
import errno
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from stat import S_IWGRP, S_IWOTH
from typing import Any

#: Errors of file systems without fsync.
_CANNOT = (errno.EINVAL, errno.ENOTSUP)

#: Mode bits of files that other users than their owner can write.
_OTHERS_WRITE = S_IWGRP | S_IWOTH

#: Polling interval of a pipe on Windows [s].
_INTERVAL = 0.1

#: Windows waits for at most 63 handles at once, and the starting process needs two of them.
_MOST_PROCESSES = 61


def can_isolate() -> bool:
    """Return True if child processes inherit sockets by their numbers."""
    return sys.platform != "win32"


# Files and folders


def sync_to_disk(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk, so that it survives a power cut.

    Raises:
        OSError: it could not be written; some file systems report that only now.

    """
    if sys.platform == "win32":
        # NTFS writes names by itself, and folders cannot be opened.
        if not path.is_dir():
            with path.open("r+b") as file:
                os.fsync(file.fileno())
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        _sync(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
    finally:
        os.close(descriptor)


def _sync(descriptor: int) -> None:
    if sys.platform == "darwin":
        # On macOS fsync does not flush the drive, and some file systems lack F_FULLFSYNC.
        fcntl = import_module("fcntl")
        with suppress(OSError):
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
            return
    os.fsync(descriptor)


def rename_to_new(path: Path, new: Path) -> None:
    """Rename a file or folder without replacing another one.

    Raises:
        FileExistsError: the new name is taken.
        OSError: it cannot be renamed.

    """
    if sys.platform == "win32":
        path.rename(new)
        return
    if path.is_dir() and not path.is_symlink():
        new.mkdir()
    else:
        new.touch(exist_ok=False)
    # This replaces only the empty file or folder made above.
    path.replace(new)


def is_still(descriptor: int, status: os.stat_result) -> bool:
    """Return True if a descriptor is still the same open file: an FMU may have closed it."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), status)
    return False


def is_mine(status: os.stat_result, or_roots: bool = False) -> bool:
    """Return True if a file belongs to this user; always on Windows, where its folder decides."""
    if sys.platform == "win32":
        return True
    return status.st_uid in ((os.geteuid(), 0) if or_roots else (os.geteuid(),))


def others_write(status: os.stat_result) -> bool:
    """Return True if other users can write a file or folder; never on Windows."""
    return sys.platform != "win32" and bool(status.st_mode & _OTHERS_WRITE)


# Processes and signals


def most_processes() -> int:
    """Return the largest number of worker processes."""
    return _MOST_PROCESSES if sys.platform == "win32" else sys.maxsize


def never_wait_for_pipe(descriptor: int) -> None:
    """Make a pipe that signals are written into non-blocking (Windows: nothing to do)."""
    if sys.platform != "win32":
        os.set_blocking(descriptor, False)


@contextmanager
def without_interrupt() -> Iterator[None]:
    """Start threads and processes in the context that do not receive Ctrl-C."""
    if sys.platform == "win32":
        # Child processes inherit this setting.
        windows: Any = ctypes
        kernel = windows.WinDLL("kernel32")
        kernel.SetConsoleCtrlHandler(None, True)
        try:
            yield
        finally:
            kernel.SetConsoleCtrlHandler(None, False)
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def wait_for_end(pipe: int) -> None:
    """Wait until the other end of a pipe that carries no data is closed."""
    if sys.platform == "win32":
        # A thread that reads would block all others that use the pipe.
        handle = import_module("msvcrt").get_osfhandle(pipe)
        peek = import_module("_winapi").PeekNamedPipe
        with suppress(BrokenPipeError):
            while True:
                peek(handle, 0)
                time.sleep(_INTERVAL)
        return
    os.read(pipe, 1)


def end_first_without_memory() -> None:
    """Ask the system to kill this process before others if memory runs out."""
    if sys.platform == "linux":
        with suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000")


# Libraries


def floating_point_calls() -> tuple[Callable[..., object], ...]:
    """Return the C functions that reset, get and set the floating-point mode."""
    if sys.platform == "win32":
        c = ctypes.PyDLL("ucrtbase")
        return c._fpreset, c.fegetenv, c.fesetenv
    c = ctypes.PyDLL(None)
    if sys.platform == "darwin":
        default: Any = ctypes.byref(ctypes.c_char.in_dll(c, "_FE_DFL_ENV"))
    else:
        default = ctypes.c_void_p(-1)
    return partial(c.fesetenv, default), c.fegetenv, c.fesetenv
