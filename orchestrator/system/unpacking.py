"""Archives unpacked once a process and version.

A version is unpacked into a temporary folder of the process, which ends with it. Running a system
again then neither unzips an FMU nor loads its library a second time.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from shutil import rmtree
from tempfile import gettempdir, mkdtemp
from threading import Lock
from typing import NamedTuple
from zipfile import ZipFile, ZipInfo

from orchestrator.errors import InputError, reason
from orchestrator.reading import check_file
from orchestrator.system.leftovers import process_folder

#: An archive that holds more than this is not unpacked, nor one that does so with those in it.
_MOST_FILES, _MOST_BYTES = 100_000, 2**30

#: Folders in folders that an archive may have: Python enters them one in the other.
_MOST_FOLDERS = 100

#: No more than this is unpacked in a process [bytes].
_MOST_OF_A_PROCESS = 2**33

#: Files of an archive that are read into memory, and how long they may be [bytes].
_DESCRIPTIONS, _MOST_OF_A_DESCRIPTION = (".xml", ".ssd", ".ssv", ".ssm"), 100_000_000

#: Runs in several threads share what is unpacked.
_LOCK = Lock()


@dataclass
class _Whole:
    """An archive, and how much it and those in it have been unpacked to."""

    archive: Path
    files: int = 0
    bytes: int = 0


#: By the folders that they are unpacked into.
_wholes: dict[Path, _Whole] = {}


class Version(NamedTuple):
    """A file as it is now; another content has another version."""

    path: Path
    modified: int
    size: int
    inode: int


def version_of(path: Path) -> Version:
    """The version of a file.

    Raises:
        InputError: there is no such file.

    """
    check_file(path)
    status = path.stat()
    return Version(path.resolve(), status.st_mtime_ns, status.st_size, status.st_ino)


def unpacked(archive: Path) -> Path:
    """The folder into which an FMU or SSP has been unpacked.

    Raises:
        InputError: it cannot be unpacked.

    """
    version = version_of(archive)
    try:
        with _LOCK:
            return _unpacked(version)
    except InputError:
        raise
    # What is wrong with an archive, each of Python's decompressors says in exceptions of its own.
    except Exception as error:
        raise InputError(f"{archive}: cannot be opened: {reason(error)}") from error


@cache
def _unpacked(archive: Version) -> Path:
    place = process_folder().resolve()
    with ZipFile(archive.path) as content:
        entries = content.infolist()
        _check(entries)
        around = (_wholes.get(folder) for folder in archive.path.parents)
        whole = next(filter(None, around), None) or _Whole(archive.path)
        files, size = len(entries), sum(entry.file_size for entry in entries)
        _check_with(whole, files, size)
        try:
            folder = Path(mkdtemp(dir=place))
            try:
                content.extractall(folder)
            except BaseException:
                rmtree(folder, ignore_errors=True)
                raise
        except OSError as error:
            raise InputError(
                f"{archive.path}: cannot be unpacked into {gettempdir()}: {reason(error)}; set "
                "TMPDIR to another folder"
            ) from error
    _wholes[folder] = whole
    whole.files += files
    whole.bytes += size
    return folder


def _check_with(whole: _Whole, files: int, size: int) -> None:
    """Refuse what fills the disk together with what there is."""
    within = f"and {whole.archive} with all that is in it to"
    if (together := whole.files + files) > _MOST_FILES:
        raise ValueError(
            f"it unpacks to {files:,} files, {within} {together:,}, more than {_MOST_FILES:,}"
        )
    if (together := whole.bytes + size) > _MOST_BYTES:
        raise ValueError(
            f"it unpacks to {size:,} bytes, {within} {together:,}, more than {_MOST_BYTES:,}"
        )
    others = {id(one): one.bytes for one in _wholes.values()}
    if (together := sum(others.values()) + size) > _MOST_OF_A_PROCESS:
        raise ValueError(
            f"it unpacks to {size:,} bytes, and all archives of this process to {together:,}, more "
            f"than {_MOST_OF_A_PROCESS:,}: run them in processes of their own"
        )


def _check(entries: Sequence[ZipInfo]) -> None:
    """Refuse what fills the disk or the memory, and what tools unpack in different ways."""
    if len(entries) > _MOST_FILES:
        raise ValueError(f"it holds {len(entries):,} files, more than {_MOST_FILES:,}")
    if sum(entry.file_size for entry in entries) > _MOST_BYTES:
        size = sum(entry.file_size for entry in entries)
        raise ValueError(f"it unpacks to more than {_MOST_BYTES:,} bytes: {size:,}")
    names = set()
    for entry in entries:
        path = PurePosixPath(entry.filename.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts:
            raise ValueError(f"it holds {entry.filename!r}, which leads out of it")
        if (depth := len(path.parts) - 1) > _MOST_FOLDERS:
            raise ValueError(
                f"it holds {path.parts[0]:.40}/…, {depth:,} folders deep, more than {_MOST_FOLDERS}"
            )
        if path in names:
            raise ValueError(f"it holds {entry.filename!r} twice")
        names.add(path)
        if path.suffix in _DESCRIPTIONS and entry.file_size > _MOST_OF_A_DESCRIPTION:
            raise ValueError(f"{entry.filename!r} is longer than {_MOST_OF_A_DESCRIPTION:,} bytes")


def runs_python(folder: Path) -> bool:
    """Whether an unpacked FMU is one of PythonFMU's."""
    return (folder / "resources" / "slavemodule.txt").is_file()


def check_place(folder: Path) -> None:
    """Check that an unpacked FMU can be told where it is.

    Raises:
        InputError: it cannot; the text says what to do.

    """
    # PythonFMU 0.7 does not decode the URI of its folder, but for spaces, and crashes its host. Our
    # loader, which has PythonFMU's library beside it, does that for it.
    loader = any((folder / "binaries").glob("*/*_pythonfmu.*"))
    if (
        runs_python(folder)
        and not loader
        and (odd := re.sub(r"[\w./~-]| ", "", str(folder), flags=re.ASCII))
    ):
        raise InputError(
            f"temporary folder {str(folder)!r}: PythonFMU takes no {odd[0]!r} in it; set TMPDIR to "
            "another, or build the FMU with --loader native"
        )
