"""What only one process may have, and what it leaves behind when it is killed.

Who works on a file or folder holds a lock on it, which ends with the process, however that ends:
what bears a name of ours and is not locked, nobody needs any more.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory, gettempdir

try:
    import fcntl
except ImportError:  # pragma: no cover
    # Not a POSIX system: nobody is kept out there, and nothing is removed.
    fcntl = None  # type: ignore[assignment]

#: How the name of a process's temporary folder begins.
_PREFIX = "auvfmu-"


@contextmanager
def claimed(path: Path, wait: bool = False) -> Iterator[None]:
    """Keep other processes from a file or folder.

    Args:
        path: of the file or folder.
        wait: for another process that has it.

    Raises:
        BlockingIOError: another process has it.
        OSError: it cannot be opened.

    """
    if fcntl is None:
        yield
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        _lock(descriptor, wait)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def created(path: Path) -> Iterator[None]:
    """Make an empty file under a name that nobody else has, and keep other processes from it.

    Raises:
        OSError: it cannot be made.

    """
    with ExitStack() as stack:
        is_there = False
        while not is_there:
            path.touch()
            # Another process may take it for left before it is locked.
            with suppress(FileNotFoundError):
                stack.enter_context(claimed(path, wait=True))
                is_there = path.exists()
        yield


def _lock(descriptor: int, wait: bool = False) -> bool:
    """Lock a file; whether that can be known, which not every file system can tell.

    Raises:
        BlockingIOError: another process has it.

    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        raise
    except OSError:
        return False
    return True


def remove_left(folder: Path, pattern: str) -> None:
    """Remove the files and folders of a pattern that no process has claimed."""
    for path in folder.glob(pattern) if fcntl is not None else ():
        # Of another user, or gone meanwhile.
        with suppress(OSError):
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                if _lock(descriptor):
                    rmtree(path) if path.is_dir() else path.unlink()
            finally:
                os.close(descriptor)


def process_folder() -> Path:
    """The folder for what nobody needs after this process; it goes when the process ends."""
    return Path(_process_folder().name)


@cache
def _process_folder() -> TemporaryDirectory[str]:
    remove_left(Path(gettempdir()), f"{_PREFIX}*")
    while True:
        folder = TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
        if fcntl is None:
            return folder
        # Another process may take it for left before it is locked.
        with suppress(FileNotFoundError):
            # Held until the process ends: nothing closes it.
            descriptor = os.open(folder.name, os.O_RDONLY)
            with suppress(OSError):
                _lock(descriptor)
                if os.path.samestat(os.fstat(descriptor), Path(folder.name).stat()):
                    return folder
            os.close(descriptor)
