"""What processes leave each other on the disk, also when they are killed or the power is cut.

Files are on the disk before they count, and records carry a checksum over themselves. A process
that works on a folder holds a lock on it, which ends with the process, however that ends. Its
temporary folder holds a marker, too: one with a marker and without a lock is not needed any more.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from shutil import rmtree
from stat import S_ISDIR
from tempfile import TemporaryDirectory, gettempdir
from threading import RLock
from typing import Any
from uuid import uuid4

from orchestrator.machine.operating_system import is_mine, sync_to_disk, take_lock

#: The entry of a record with its checksum.
_SEAL = "sha256"

#: How the name of a process's temporary folder begins, and the file that proves it to be one.
_PREFIX, _MARKER = "auvfmu-", ".auv-fmu.json"

#: Held while that folder is made: threads must not make one each, but a signal may ask for it.
_MAKING = RLock()


def sealed(content: Mapping[str, Any]) -> str:
    """The text of a record, with its checksum."""
    return json.dumps({**content, _SEAL: _checksum(content)})


def unsealed(text: str) -> dict[str, Any]:
    """The content of a record that is as it was written.

    Raises:
        ValueError: it is not, or is not such a record.

    """
    content = json.loads(text)
    if not isinstance(content, dict) or _SEAL not in content:
        raise ValueError("it has no checksum")
    if content.pop(_SEAL) != _checksum(content) or sealed(content) != text:
        raise ValueError("it is damaged: its checksum differs")
    return content


def _checksum(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content).encode()).hexdigest()


def write_new(path: Path, text: str) -> None:
    """Write a text into a file that is not there yet; nor may a link be, which could lead anywhere.

    Raises:
        OSError: it is there, or cannot be written.

    """
    with path.open("x", encoding="utf-8") as file:
        file.write(text)


def write_whole(path: Path, text: str, partial: Path) -> None:
    """Have a file hold a text: whatever happens meanwhile, it is the one before or this one.

    Args:
        path: of the file.
        text: that it shall hold.
        partial: beside it, a name that nobody else has: what a killed process left there is ours.

    Raises:
        OSError: it cannot be written.

    """
    partial.unlink(missing_ok=True)
    write_new(partial, text)
    sync_to_disk(partial)
    partial.replace(path)
    sync_to_disk(path.parent)


def is_still(descriptor: int, status: os.stat_result) -> bool:
    """Whether a descriptor is the file that it was, not closed since nor taken by another one."""
    with suppress(OSError):
        return os.path.samestat(os.fstat(descriptor), status)
    return False


@contextmanager
def hold_lock(path: Path, wait: bool = False) -> Iterator[None]:
    """Keep other processes from a file or folder.

    Args:
        path: of the file or folder.
        wait: for another process that has it.

    Raises:
        BlockingIOError: another process has it.
        OSError: it cannot be opened.

    """
    release: Callable[[], object] = bool
    # Where there are no locks, nobody is kept out.
    with suppress(NotImplementedError):
        release = take_lock(path, wait)
    try:
        yield
    finally:
        # An FMU may have closed it.
        with suppress(OSError):
            release()


def process_folder() -> Path:
    """The folder for what is not needed after this process; it goes when the process ends."""
    with _MAKING:
        return Path(_process_folder().name)


@cache
def _process_folder() -> TemporaryDirectory[str]:
    _remove_left()
    folder = TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
    # Without the marker it is not removed by others.
    with suppress(OSError, NotImplementedError):
        # Held until the process ends: nothing releases it.
        take_lock(Path(folder.name))
        marker = sealed({"folder": Path(folder.name).name, "token": uuid4().hex})
        Path(folder.name, _MARKER).write_text(marker, encoding="utf-8")
    return folder


def _remove_left() -> None:
    """Remove the temporary folders of processes that were killed."""
    for folder in Path(gettempdir()).glob(f"{_PREFIX}*"):
        # Of another user, or gone meanwhile.
        with suppress(OSError, NotImplementedError):
            if not _is_ours(folder):
                continue
            release = take_lock(folder)
            try:
                for path in folder.iterdir():
                    if path.is_dir() and not path.is_symlink():
                        rmtree(path)
                    # The proof comes last: this process may be killed, too.
                    elif path.name != _MARKER:
                        path.unlink()
                rmtree(folder)
            finally:
                release()


def _is_ours(folder: Path) -> bool:
    """Whether a folder says itself that a process of this user has made it."""
    marker, status = folder / _MARKER, folder.lstat()
    try:
        if not (S_ISDIR(status.st_mode) and is_mine(status)) or marker.is_symlink():
            return False
        return unsealed(marker.read_text(encoding="utf-8")).get("folder") == folder.name
    except ValueError:
        return False
