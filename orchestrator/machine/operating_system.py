"""What differs between operating systems: this module asks which one there is, and no other.

Linux is where all of it is tried. Windows is tried under wine, and macOS not at all.
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

#: Answers of file systems without fsync.
_CANNOT = (errno.EINVAL, errno.ENOTSUP)

#: That others than its owner can write a file or folder.
_OTHERS_WRITE = S_IWGRP | S_IWOTH

#: How often Windows is asked about what it does not tell [s].
_GLANCE = 0.1

#: What Windows answers if there is a mutex of a name already.
_ALREADY_EXISTS, _ACCESS_DENIED = 183, 5

#: Windows waits for at most 63 handles at once; two are for the process that starts the others.
_MOST_PROCESSES = 61


def can_isolate() -> bool:
    """Whether processes inherit sockets by their numbers."""
    return sys.platform != "win32"


# Files and folders


def sync_to_disk(path: Path) -> None:
    """Have a file, or the names in a folder, outlast a power cut.

    Raises:
        OSError: it is not all there; some file systems say so only now.

    """
    if sys.platform == "win32":
        # NTFS keeps the names itself, and a folder cannot be opened.
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
        # There fsync leaves it to the drive when it writes; not every file system knows more.
        fcntl = import_module("fcntl")
        with suppress(OSError):
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
            return
    os.fsync(descriptor)


def take_lock(path: Path, wait: bool = False) -> Callable[[], None]:
    """Lock a file or folder for this process; gives what unlocks it, as the process's end does.

    Args:
        path: of the file or folder.
        wait: for another process that has it.

    Raises:
        BlockingIOError: another process has it.
        NotImplementedError: the file system has no locks.
        OSError: there is no such file or folder, or it cannot be opened.

    """
    if sys.platform == "win32":
        # A folder cannot be opened there. The file system's number for it is the same in all
        # processes, whatever path they have for it.
        status = path.stat()
        return _take_name(f"Global\\auv-fmu-{status.st_dev:x}-{status.st_ino:x}", wait)
    import fcntl  # noqa: PLC0415

    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BaseException as error:
        os.close(descriptor)
        if isinstance(error, OSError) and not isinstance(error, BlockingIOError):
            raise NotImplementedError(f"{path}: {error.strerror}") from error
        raise
    return partial(os.close, descriptor)


def _take_name(name: str, wait: bool) -> Callable[[], None]:
    """Take a named mutex, which goes with its last handle."""
    kernel = _kernel()
    kernel.CreateMutexW.restype = ctypes.c_void_p
    while True:
        handle = kernel.CreateMutexW(None, False, name)
        answer = _last_error()
        release = partial(kernel.CloseHandle, ctypes.c_void_p(handle))
        if handle and answer != _ALREADY_EXISTS:
            return release
        if handle:
            release()
        elif answer != _ACCESS_DENIED:
            raise NotImplementedError(f"{name}: Windows error {answer}")
        if not wait:
            raise BlockingIOError(errno.EAGAIN, "another process has it")
        time.sleep(_GLANCE)


def rename_to_new(path: Path, new: Path) -> None:
    """Rename a file or folder, and replace nothing.

    Raises:
        FileExistsError: the name is taken.
        OSError: it cannot be renamed.

    """
    if sys.platform == "win32":
        path.rename(new)
        return
    if path.is_dir() and not path.is_symlink():
        new.mkdir()
    else:
        new.touch(exist_ok=False)
    # In the place of what was made just now, and of nothing else.
    path.replace(new)


def is_mine(status: os.stat_result, or_roots: bool = False) -> bool:
    """Whether a file is this user's; on Windows its folder decides that."""
    if sys.platform == "win32":
        return True
    return status.st_uid in ((os.geteuid(), 0) if or_roots else (os.geteuid(),))


def others_write(status: os.stat_result) -> bool:
    """Whether other users can write a file or folder; on Windows they cannot write a user's own."""
    return sys.platform != "win32" and bool(status.st_mode & _OTHERS_WRITE)


# Processes and signals


def most_processes() -> int:
    """How many processes one can have to work for it."""
    return _MOST_PROCESSES if sys.platform == "win32" else sys.maxsize


def never_wait_for_pipe(descriptor: int) -> None:
    """Have what a signal writes into a pipe never wait; on Windows a thread of its own writes."""
    if sys.platform != "win32":
        os.set_blocking(descriptor, False)


@contextmanager
def without_interrupt() -> Iterator[None]:
    """Threads and processes that are started here never see Ctrl-C, which is for this to answer."""
    if sys.platform == "win32":
        # Processes inherit that they ignore it.
        kernel = _kernel()
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
    """Wait until the other end of a pipe is closed, into which nothing is written."""
    if sys.platform == "win32":
        # One thread that reads would hold up all others that ask for anything about it.
        handle = import_module("msvcrt").get_osfhandle(pipe)
        peek = import_module("_winapi").PeekNamedPipe
        with suppress(BrokenPipeError):
            while True:
                peek(handle, 0)
                time.sleep(_GLANCE)
        return
    os.read(pipe, 1)


def end_first_without_memory() -> None:
    """Have the system end this process before others if memory is short."""
    if sys.platform == "linux":
        with suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000")


# Libraries


def floating_point_calls() -> tuple[Callable[..., object], ...]:
    """C's functions for the floating-point mode: to take on the default, to get, and to set one."""
    if sys.platform == "win32":
        c = ctypes.PyDLL("ucrtbase")
        return c._fpreset, c.fegetenv, c.fesetenv
    c = ctypes.PyDLL(None)
    if sys.platform == "darwin":
        default: Any = ctypes.byref(ctypes.c_char.in_dll(c, "_FE_DFL_ENV"))
    else:
        default = ctypes.c_void_p(-1)
    return partial(c.fesetenv, default), c.fegetenv, c.fesetenv


def _kernel() -> Any:
    windows: Any = ctypes
    return windows.WinDLL("kernel32", use_last_error=True)


def _last_error() -> int:
    windows: Any = ctypes
    return int(windows.get_last_error())
