"""Archives unpacked once a process and version.

A version is unpacked into a temporary folder of the process, which ends with it. Running a system
again then neither unzips an FMU nor loads its library a second time.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
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

#: An archive that holds more than this is not unpacked.
_MOST_FILES, _MOST_BYTES = 100_000, 2**30

#: Files of an archive that are read into memory, and how long they may be [bytes].
_DESCRIPTIONS, _MOST_OF_A_DESCRIPTION = (".xml", ".ssd", ".ssv", ".ssm"), 100_000_000

#: Runs in several threads share what is unpacked.
_LOCK = Lock()


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
    with ZipFile(archive.path) as content:
        _check(content.infolist())
        try:
            folder = Path(mkdtemp(dir=process_folder()))
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
    return folder


def _check(entries: Sequence[ZipInfo]) -> None:
    """Refuse what fills the disk or the memory, and what tools unpack in different ways."""
    if len(entries) > _MOST_FILES:
        raise ValueError(f"it holds {len(entries):,} files, more than {_MOST_FILES:,}")
    if sum(entry.file_size for entry in entries) > _MOST_BYTES:
        raise ValueError(f"it unpacks to more than {_MOST_BYTES:,} bytes")
    names = set()
    for entry in entries:
        path = PurePosixPath(entry.filename.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts:
            raise ValueError(f"it holds {entry.filename!r}, which leads out of it")
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
