"""Differences between operating systems: no other module asks which one there is.

All branches of Linux are tested, those of Windows under wine, and those of macOS with fakes only.
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

#: Modes of a file or folder that others than its owner can write.
_OTHERS_WRITE = S_IWGRP | S_IWOTH

#: Interval at which a pipe of Windows is looked at [s].
_INTERVAL = 0.1

#: Windows waits for at most 63 handles at once; two are for the process that starts the others.
_MOST_PROCESSES = 61


def can_isolate() -> bool:
    """Whether processes inherit sockets by their numbers."""
    return sys.platform != "win32"


# Files and folders


def sync_to_disk(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk, so that it outlasts a power cut.

    Raises:
        OSError: the disk has not taken all of it; some file systems say so only now.

    """
    if sys.platform == "win32":
        # NTFS writes names itself, and a folder cannot be opened.
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
        # There fsync does not flush the drive; not every file system knows F_FULLFSYNC.
        fcntl = import_module("fcntl")
        with suppress(OSError):
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
            return
    os.fsync(descriptor)


def rename_to_new(path: Path, new: Path) -> None:
    """Rename a file or folder without replacing another one.

    Raises:
        FileExistsError: there is one of the new name.
        OSError: it cannot be renamed.

    """
    if sys.platform == "win32":
        path.rename(new)
        return
    if path.is_dir() and not path.is_symlink():
        new.mkdir()
    else:
        new.touch(exist_ok=False)
    # Replaces only what was made just now.
    path.replace(new)


def is_still(descriptor: int, status: os.stat_result) -> bool:
    """Tell whether a descriptor is still the same open file: an FMU may have closed it."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), status)
    return False


def is_mine(status: os.stat_result, or_roots: bool = False) -> bool:
    """Tell whether a file belongs to this user; on Windows always, as its folder decides that."""
    if sys.platform == "win32":
        return True
    return status.st_uid in ((os.geteuid(), 0) if or_roots else (os.geteuid(),))


def others_write(status: os.stat_result) -> bool:
    """Tell whether other users can write a file or folder; on Windows they never can."""
    return sys.platform != "win32" and bool(status.st_mode & _OTHERS_WRITE)


# Processes and signals


def most_processes() -> int:
    """Largest number of worker processes."""
    return _MOST_PROCESSES if sys.platform == "win32" else sys.maxsize


def never_wait_for_pipe(descriptor: int) -> None:
    """Make a pipe that signals are written into non-blocking (Windows: nothing to do)."""
    if sys.platform != "win32":
        os.set_blocking(descriptor, False)


@contextmanager
def without_interrupt() -> Iterator[None]:
    """Start threads and processes that do not receive Ctrl-C, which only this process answers."""
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
    """Wait until the other end of a pipe is closed, which nothing is written to."""
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
    """Have the system end this process before others if memory is short."""
    if sys.platform == "linux":
        with suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000")


# Libraries


def floating_point_calls() -> tuple[Callable[..., object], ...]:
    """C functions that reset, get and set the floating-point mode."""
    if sys.platform == "win32":
        c = ctypes.PyDLL("ucrtbase")
        return c._fpreset, c.fegetenv, c.fesetenv
    c = ctypes.PyDLL(None)
    if sys.platform == "darwin":
        default: Any = ctypes.byref(ctypes.c_char.in_dll(c, "_FE_DFL_ENV"))
    else:
        default = ctypes.c_void_p(-1)
    return partial(c.fesetenv, default), c.fegetenv, c.fesetenv
