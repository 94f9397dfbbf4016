"""Files and folders: names, checksums, atomic writes, locks and temporary folders.

A process that works on a folder holds a lock on it, which ends with the process, even if that is
killed. So a temporary folder without a lock was left by a killed process, and is removed.
"""

from __future__ import annotations

import atexit
import errno
import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import file_digest, sha256
from itertools import count
from multiprocessing.util import Finalize
from pathlib import Path
from shutil import rmtree
from stat import S_ISDIR
from tempfile import TemporaryDirectory, gettempdir
from threading import RLock
from typing import TYPE_CHECKING, Any

from orchestrator.machine.operating_system import is_mine, rename_to_new, sync_to_disk

if TYPE_CHECKING:
    from filelock import BaseFileLock

#: The lock file of a folder: empty, and removed at the end.
LOCK = ".auv-fmu.lock"

#: Errors of file systems without locks.
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)

#: Key of the checksum in a record.
_SEAL = "sha256"

#: Prefix of temporary folders, and the file in each that holds its name.
_PREFIX, _MARKER = "auvfmu-", ".auv-fmu.json"

#: Letters that some system does not accept in file names, and names that Windows reserves.
_ODD = re.compile(r"[^\w .()+=,@~-]")
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.I)

#: Longest name [bytes], which leaves room for suffixes.
_LONGEST = 120

#: Priority of a task that is the last of a process.
_LAST = -100

#: Threads must not make a temporary folder each; reentrant, since a signal handler may need it.
_MAKING = RLock()


# Records with a checksum


def sealed(content: Mapping[str, Any]) -> str:
    """Write a record as JSON, with its checksum."""
    return json.dumps({**content, _SEAL: _checksum(content)})


def unsealed(text: str) -> dict[str, Any]:
    """Read a record that :func:`sealed` has written.

    Raises:
        ValueError: it was changed since, or is not such a record.

    """
    content = json.loads(text)
    if not isinstance(content, dict) or _SEAL not in content:
        raise ValueError("it has no checksum")
    if content.pop(_SEAL) != _checksum(content) or sealed(content) != text:
        raise ValueError("it is damaged: its checksum differs")
    return content


def _checksum(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content).encode()).hexdigest()


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


# Files


def has_slash(name: str) -> bool:
    """Return True if a name, as a part of a path, would lead into another folder."""
    return "/" in name or "\\" in name


def file_name(name: str, taken: Collection[str] = ()) -> str:
    """Return a file name that every system accepts, and that no other name is turned into.

    It differs from the names that are taken in the same folder.
    """
    plain = _ODD.sub("_", name).strip(" ").rstrip(".")
    plain = plain.encode()[:_LONGEST].decode(errors="ignore")
    if not plain or plain.startswith(".") or _RESERVED.match(plain):
        plain = f"_{plain}"
    if plain != name:
        plain += f"-{sha256(name.encode(errors='surrogatepass')).hexdigest()[:8]}"
    others = {other.casefold() for other in taken}
    while plain.casefold() in others:
        plain += "_"
    return plain


def plain_file_names(names: Iterable[str], *taken: str) -> list[str]:
    """Return file names that need no encoding in a URI: some hosts do not decode URIs.

    No two are equal or differ in case only, since some file systems ignore case.
    """
    file_names: list[str] = []
    used = {name.lower() for name in taken}
    for name in names:
        base = re.sub(r"[^\w.-]", "_", name, flags=re.ASCII)
        free, number = base, len(file_names)
        while free.lower() in used:
            free, number = f"{number}_{base}", number + 1
        file_names.append(free)
        used.add(free.lower())
    return file_names


def write_whole(path: Path, text: str, partial: Path) -> None:
    """Write a text file atomically: after a crash it holds the old text or the new one.

    The unfinished file `partial` is in the same folder, and nothing else uses its name.

    Raises:
        OSError: it cannot be written.

    """
    partial.unlink(missing_ok=True)
    # "x" follows no link, which could lead anywhere.
    with partial.open("x", encoding="utf-8") as file:
        file.write(text)
    sync_to_disk(partial)
    partial.replace(path)
    sync_to_disk(path.parent)


def move_aside(path: Path) -> Path:
    """Rename a user's file or folder to NAME.~N~, and return the new path.

    Raises:
        OSError: it cannot be renamed.

    """
    for n in count(1):
        aside = path.with_name(f"{path.name}.~{n}~")
        with suppress(FileExistsError):
            rename_to_new(path, aside)
            return aside
    raise AssertionError


# Locks and temporary folders


@contextmanager
def hold_lock(folder: Path, wait: bool = False) -> Iterator[None]:
    """Keep other processes out of an existing folder; with `wait`, wait until none is in it.

    Raises:
        BlockingIOError: another process is in it.
        OSError: the folder cannot be written.

    """
    lock = _lock_of(folder)
    try:
        lock.acquire(blocking=wait)
    except TimeoutError:
        raise BlockingIOError(errno.EAGAIN, "another process is in it") from None
    except OSError as error:
        # On a file system without locks, continue without one.
        if error.errno not in _NO_LOCKS:
            raise
    try:
        yield
    finally:
        # Before the release: later it could belong to another process.
        is_open = not _remove_lock(folder / LOCK)
        _release(lock)
        if is_open:
            _remove_lock(folder / LOCK)


def _remove_lock(path: Path) -> bool:
    """Remove a lock file if it is empty; False if Windows refuses because it is open."""
    with suppress(FileNotFoundError):
        try:
            if path.is_file() and not path.is_symlink() and not path.stat().st_size:
                path.unlink()
        except PermissionError:
            return False
    return True


def _release(lock: BaseFileLock) -> None:
    with suppress(OSError):
        # An FMU may have closed its descriptor.
        lock.release()


def _lock_of(folder: Path) -> BaseFileLock:
    # Slow to import.
    from filelock import FileLock  # noqa: PLC0415

    return FileLock(folder / LOCK, thread_local=False, preserve_lock_file=True)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Provide a temporary folder for the context; it is removed even if the process is killed."""
    with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def process_folder() -> Path:
    """Return the temporary folder of this process, which is removed when the process ends."""
    with _MAKING:
        return Path(_process_folder().name)


@cache
def _process_folder() -> TemporaryDirectory[str]:
    _remove_left()
    folder = TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
    path = Path(folder.name)
    # Else Python removes it with a warning.
    atexit.register(folder.cleanup)
    # Forked processes end without atexit.
    Finalize(None, folder.cleanup, exitpriority=_LAST)
    # If no marker can be written, no other process will remove it.
    with suppress(OSError):
        lock = _lock_of(path)
        lock.acquire(blocking=False)
        # Held until the process ends; Windows removes no file that is open.
        atexit.register(_release, lock)
        (path / _MARKER).write_text(path.name, encoding="utf-8")
    return folder


def _remove_left() -> None:
    """Remove the temporary folders of processes that were killed."""
    for folder in Path(gettempdir()).glob(f"{_PREFIX}*"):
        # It may be another user's, in use, or gone.
        with suppress(OSError, ValueError):
            if not _is_ours(folder):
                continue
            with hold_lock(folder):
                for path in folder.iterdir():
                    if path.is_dir() and not path.is_symlink():
                        rmtree(path)
                    # The marker goes last, as this process may be killed, too.
                    elif path.name not in (_MARKER, LOCK):
                        path.unlink()
                (folder / _MARKER).unlink()
            folder.rmdir()


def _is_ours(folder: Path) -> bool:
    """Return True if a process of this user made a temporary folder: its marker has its name."""
    marker, status = folder / _MARKER, folder.lstat()
    if not (S_ISDIR(status.st_mode) and is_mine(status)) or marker.is_symlink():
        return False
    return marker.read_text(encoding="utf-8") == folder.name
