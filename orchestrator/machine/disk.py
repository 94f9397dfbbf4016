"""What processes leave each other on the disk, also when they are killed or the power is cut.

Files are on the disk before they count, and records carry a checksum over themselves. A process
that works on a folder holds a lock on it, which ends with the process, however that ends. Its
temporary folder holds a marker, too: one with a marker and without a lock is not needed any more.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory, gettempdir
from typing import Any
from uuid import uuid4

try:
    import fcntl
except ImportError:  # pragma: no cover
    # Not a POSIX system: no process is kept out there, and nothing is removed.
    fcntl = None  # type: ignore[assignment]

#: The entry of a record with its checksum.
_SEAL = "sha256"

#: What file systems answer that know no fsync.
_CANNOT = (errno.EINVAL, errno.ENOTSUP)

#: How the name of a process's temporary folder begins, and the file that proves it to be one.
_PREFIX, _MARKER = "auvfmu-", ".auv-fmu.json"


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


def sync_to_disk(path: Path) -> None:
    """Have a file, or the names in a folder, outlast a power cut.

    Raises:
        OSError: it is not all there; some file systems say so only now.

    """
    if os.name != "posix":
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
    finally:
        os.close(descriptor)


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
            marker = sealed({"folder": Path(folder.name).name, "token": uuid4().hex})
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
