"""Files that the user names: only regular ones, so that none blocks and none is endless.

Archives are unpacked once a process and content, into a temporary folder of the process, which ends
with it. Running a system again then neither unzips an FMU nor loads its library a second time; and
what was read of a file stays what it was, whatever becomes of the file.
"""

from __future__ import annotations

import csv
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path, PurePosixPath
from shutil import rmtree
from stat import S_ISDIR, S_ISREG
from tempfile import gettempdir, mkdtemp
from threading import Lock
from typing import NamedTuple, TextIO, TypeAlias
from zipfile import ZipFile, ZipInfo

from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, did_you_mean, reason

#: Longest file that is read as a whole, and longest line of one that is not [characters].
_LONGEST, _LONGEST_LINE = 10_000_000, 1_000_000

#: An archive that holds more than this is not unpacked, nor one that does so with those in it.
_MOST_FILES, _MOST_BYTES = 100_000, 2**30

#: Nor one that is longer than this, whatever it says that it holds [bytes].
_LONGEST_ARCHIVE = 2 * _MOST_BYTES

#: Folders in folders that an archive may have: Python enters them one in the other.
_MOST_FOLDERS = 100

#: No more than this is unpacked in a process [bytes].
_MOST_OF_A_PROCESS = 2**33

#: Files of an archive that are read into memory, and how long they may be [bytes].
_DESCRIPTIONS, _MOST_OF_A_DESCRIPTION = (".xml", ".ssd", ".ssv", ".ssm"), 100_000_000

#: The beginning of a file that Git has left in place of another one.
_POINTER = b"version https://git-lfs.github.com/spec/"

#: Runs in several threads share what is unpacked.
_LOCK = Lock()

#: A file as it is now; when it is written it gets another one.
_Version: TypeAlias = tuple[int, ...]


@dataclass
class _Whole:
    """An archive, and how much it and those in it have been unpacked to."""

    archive: Path
    files: int = 0
    bytes: int = 0


#: By the folders that they are unpacked into.
_wholes: dict[Path, _Whole] = {}

#: Digests by the files that had them, and folders by the digests of what is in them.
_digests: dict[_Version, str] = {}
_folders: dict[str, Path] = {}


@contextmanager
def explain_errors(path: Path, what: str) -> Iterator[None]:
    """Say of a mistake in a file which file it is.

    Args:
        path: of the file.
        what: it is if there is a mistake in it, for example `not a table`.

    """
    try:
        yield
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or reason(error)}") from error
    except RecursionError as error:
        raise InputError(f"{path}: {what}: nested too deeply") from error
    except (ValueError, csv.Error) as error:
        raise InputError(f"{path}: {what}: {reason(error)}") from error


def is_folder(path: Path) -> bool:
    """Whether there is such a folder; False also for an impossible name."""
    with suppress(OSError, ValueError):
        return path.is_dir()
    return False


def check_file(path: Path) -> None:
    """Check that a file is there that can be read to its end.

    Raises:
        InputError: there is none, or it is a folder, a pipe or a device.

    """
    with explain_errors(path, "not the name of a file"):
        try:
            mode = path.stat().st_mode
        except FileNotFoundError:
            raise InputError(f"{path}: no such file") from None
    if not S_ISREG(mode):
        what = "a folder" if S_ISDIR(mode) else "a pipe or device"
        raise InputError(f"{path}: {what}, not a file")


def read_text(path: Path, what: str) -> str:
    """Read a short file as text.

    Args:
        path: of the file.
        what: it is if it cannot be read as text.

    Raises:
        InputError: there is no such file, it is too long, or no text in UTF-8.

    """
    check_file(path)
    with explain_errors(path, what), path.open(encoding="utf-8-sig") as file:
        text = file.read(_LONGEST + 1)
        if len(text) > _LONGEST:
            raise ValueError(f"longer than {_LONGEST:,} characters")
        return text


@contextmanager
def open_lines(path: Path, newline: str | None = None) -> Iterator[Iterator[str]]:
    """Open a text in UTF-8, to take its lines one by one.

    Args:
        path: of the file.
        newline: as `open` takes it.

    Raises:
        InputError: there is no such file.
        ValueError: while lines are taken, if it is not text, or a line has no end.

    """
    check_file(path)
    with path.open(encoding="utf-8-sig", newline=newline) as file:
        yield _bounded(file)


def _bounded(file: TextIO) -> Iterator[str]:
    while line := file.readline(_LONGEST_LINE):
        if len(line) == _LONGEST_LINE:
            raise ValueError(f"a line is longer than {_LONGEST_LINE:,} characters")
        yield line


def names_in(folder: Path) -> list[str]:
    """The names of the files that come with the program in a folder, without their ending."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def find_toml(name: str, folder: Path, what: str, files: str) -> Path:
    """Find a file that comes with the program by its name, or any file of the user's by its path.

    Args:
        name: of the file, or its path, which ends in .toml.
        folder: of those that come with the program.
        what: it is, for the message.
        files: that may be given in place of a name, for the message.

    Raises:
        InputError: there is none of that name.

    """
    if name.endswith(".toml"):
        return Path(name)
    known = names_in(folder)
    if name not in known:
        raise InputError(
            f"no {what} {name!r}; there are {', '.join(known)}, or give {files}"
            f"{did_you_mean(name, known)}"
        )
    return folder / f"{name}.toml"


class Unpacked(NamedTuple):
    """An archive as it was read: the folder that it was unpacked into, and its SHA-256."""

    folder: Path
    digest: str


def unpack(archive: Path) -> Unpacked:
    """Unpack an FMU or SSP as it is now.

    Raises:
        InputError: it cannot be unpacked.

    """
    check_file(archive)
    try:
        with _LOCK, archive.open("rb") as file:
            if file.peek(len(_POINTER)).startswith(_POINTER):
                raise InputError(
                    f"{archive}: is a Git LFS pointer, not the file itself: run `git lfs pull`"
                )
            return _unpacked(archive, file)
    except InputError:
        raise
    # Each of Python's decompressors has its own exceptions for a broken archive.
    except Exception as error:
        raise InputError(f"{archive}: cannot be opened: {reason(error)}") from error


def unpacked_folder(archive: Path, digest: str) -> Path:
    """Give the folder of an archive as it was read, in this process or in another one.

    Raises:
        InputError: this process has not read it, and the file is another one now.

    """
    folder = _folders.get(digest)
    if folder is None:
        folder, now = unpack(archive)
        _check_same(archive, now, digest)
    return folder


def read_archive(archive: Path, digest: str) -> bytes:
    """Read the bytes of an archive as it was read before.

    Raises:
        InputError: the file is another one now.

    """
    check_file(archive)
    content = archive.read_bytes()
    _check_same(archive, hashlib.sha256(content).hexdigest(), digest)
    return content


def _check_same(archive: Path, now: str, digest: str) -> None:
    if now != digest:
        raise InputError(f"{archive}: has changed since it was read; start over")


def _unpacked(archive: Path, file: BufferedReader) -> Unpacked:
    version = _version_of(file)
    digest = _digests.get(version)
    if digest is None:
        with ZipFile(file) as content:
            # Before the file is read to its end, which it may not have.
            _check_entries(content)
            if (size := os.fstat(file.fileno()).st_size) > _LONGEST_ARCHIVE:
                raise ValueError(f"it is {size:,} bytes long, more than {_LONGEST_ARCHIVE:,}")
            file.seek(0)
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            if digest not in _folders:
                folder = _extracted(archive, content)
                if _version_of(file) != version:
                    rmtree(folder, ignore_errors=True)
                    raise InputError(f"{archive}: is being written; try again when it is complete")
                _folders[digest] = folder
        _digests[version] = digest
    return Unpacked(_folders[digest], digest)


def _version_of(file: BufferedReader) -> _Version:
    # A file that is written gets another time of change, whatever is done to the others.
    it = os.fstat(file.fileno())
    return it.st_dev, it.st_ino, it.st_size, it.st_mtime_ns, it.st_ctime_ns


def _extracted(archive: Path, content: ZipFile) -> Path:
    archive, entries = archive.resolve(), content.infolist()
    around = (_wholes.get(folder) for folder in archive.parents)
    whole = next(filter(None, around), None) or _Whole(archive)
    files, size = len(entries), sum(entry.file_size for entry in entries)
    _check_room(whole, files, size)
    try:
        folder = Path(mkdtemp(dir=process_folder().resolve()))
        try:
            content.extractall(folder)
        except BaseException:
            rmtree(folder, ignore_errors=True)
            raise
    except OSError as error:
        raise InputError(
            f"{archive}: cannot be unpacked into {gettempdir()}: {reason(error)}; set "
            "TMPDIR to another folder"
        ) from error
    _wholes[folder] = whole
    whole.files += files
    whole.bytes += size
    return folder


def _check_room(whole: _Whole, files: int, size: int) -> None:
    """Refuse what fills the disk together with what there is."""
    within = f"and {whole.archive} with its nested archives to"
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
            f"than {_MOST_OF_A_PROCESS:,}: run them in separate processes"
        )


def _check_entries(content: ZipFile) -> None:
    """Refuse what fills the disk or the memory, and what tools unpack in different ways."""
    entries = content.infolist()
    if len(entries) > _MOST_FILES:
        raise ValueError(f"it holds {len(entries):,} files, more than {_MOST_FILES:,}")
    if sum(entry.file_size for entry in entries) > _MOST_BYTES:
        size = sum(entry.file_size for entry in entries)
        raise ValueError(f"it unpacks to more than {_MOST_BYTES:,} bytes: {size:,}")
    known: dict[PurePosixPath, ZipInfo] = {}
    for entry in entries:
        path = PurePosixPath(entry.filename.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts:
            raise ValueError(f"it holds {entry.filename!r}, which lies outside it")
        if (depth := len(path.parts) - 1) > _MOST_FOLDERS:
            raise ValueError(
                f"it holds {path.parts[0]:.40}/…, {depth:,} folders deep, more than {_MOST_FOLDERS}"
            )
        if not _are_same(content, entry, known.setdefault(path, entry)):
            raise ValueError(f"it holds {entry.filename!r} twice, with different contents")
        if path.suffix in _DESCRIPTIONS and entry.file_size > _MOST_OF_A_DESCRIPTION:
            raise ValueError(f"{entry.filename!r} is longer than {_MOST_OF_A_DESCRIPTION:,} bytes")


def _are_same(content: ZipFile, one: ZipInfo, other: ZipInfo) -> bool:
    """Whether two entries of a path unpack to the same; some tools list one twice."""
    if one is other:
        return True
    alike = all(getattr(one, of) == getattr(other, of) for of in ("filename", "file_size", "CRC"))
    return alike and content.read(one) == content.read(other)
