"""What only one process may have, and what it leaves when it is killed.

A process that works on a folder holds a lock on it, which ends with the process, however that ends.
Its temporary folder holds a marker, too: one with a marker and without a lock is not needed any
more.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory, gettempdir
from uuid import uuid4

from orchestrator.machine.atomic import sealed, unsealed

try:
    import fcntl
except ImportError:  # pragma: no cover
    # Not a POSIX system: no process is kept out there, and nothing is removed.
    fcntl = None  # type: ignore[assignment]

#: How the name of a process's temporary folder begins, and the file that proves it to be one.
_PREFIX, _MARKER = "auvfmu-", ".auv-fmu.json"


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
        # An FMU may have closed it.
        with suppress(OSError):
            os.close(descriptor)


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


def process_folder() -> Path:
    """The folder for what is not needed after this process; it goes when the process ends."""
    return Path(_process_folder().name)


@cache
def _process_folder() -> TemporaryDirectory[str]:
    _remove_left()
    folder = TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
    if fcntl is not None:
        # Held until the process ends: nothing closes it.
        descriptor = os.open(folder.name, os.O_RDONLY)
        with suppress(OSError):
            _lock(descriptor)
            marker = sealed({"folder": Path(folder.name).name, "identity": uuid4().hex})
            Path(folder.name, _MARKER).write_text(marker, encoding="utf-8")
    return folder


def _remove_left() -> None:
    """Remove the temporary folders of processes that were killed."""
    for folder in Path(gettempdir()).glob(f"{_PREFIX}*") if fcntl is not None else ():
        # Of another user, or gone meanwhile.
        with suppress(OSError):
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                if _is_ours(folder) and _lock(descriptor):
                    for path in folder.iterdir():
                        if path.is_dir() and not path.is_symlink():
                            rmtree(path)
                        # The proof comes last: this process may be killed, too.
                        elif path.name != _MARKER:
                            path.unlink()
                    rmtree(folder)
            finally:
                os.close(descriptor)


def _is_ours(folder: Path) -> bool:
    """Whether a folder says itself that a process of this user has made it."""
    marker = folder / _MARKER
    try:
        if folder.stat().st_uid != os.geteuid() or marker.is_symlink():
            return False
        return unsealed(marker.read_text(encoding="utf-8")).get("folder") == folder.name
    except ValueError:
        return False
