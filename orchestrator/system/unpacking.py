"""Archives unpacked once a process and version.

A version is unpacked into a temporary folder of the process, which ends with it. Running a system
again then neither unzips an FMU nor loads its library a second time.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir, mkdtemp
from threading import Lock
from typing import NamedTuple
from zipfile import BadZipFile, ZipFile

from orchestrator.errors import InputError, reason
from orchestrator.system.leftovers import process_folder

#: Runs in several threads share what is unpacked.
_LOCK = Lock()


class Version(NamedTuple):
    """A file as it is now; another content has another version."""

    path: Path
    modified: int
    size: int
    inode: int


def version_of(path: Path) -> Version:
    """The version of a file that exists."""
    status = path.stat()
    return Version(path.resolve(), status.st_mtime_ns, status.st_size, status.st_ino)


def unpacked(archive: Path) -> Path:
    """The folder into which an FMU or SSP has been unpacked.

    Raises:
        InputError: it cannot be unpacked.

    """
    try:
        with _LOCK:
            return _unpacked(version_of(archive))
    except (OSError, BadZipFile, RuntimeError, NotImplementedError) as error:
        raise InputError(f"{archive}: cannot be opened: {reason(error)}") from error


@cache
def _unpacked(archive: Version) -> Path:
    with ZipFile(archive.path) as content:
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
