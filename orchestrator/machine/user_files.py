"""Files that the user names: only regular ones, since others may block or never end.

Archives are unpacked once for each process and content, into a temporary folder of the process.
Running a system again then neither unzips an FMU nor loads its library a second time, and a later
change of the archive has no effect.
"""

from __future__ import annotations

import csv
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path, PurePosixPath
from shutil import rmtree
from stat import S_ISDIR, S_ISREG
from tempfile import gettempdir, mkdtemp
from threading import Lock
from typing import NamedTuple, TextIO, TypeAlias
from zipfile import ZipFile, ZipInfo

from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, reason

#: Longest file that is read as a whole, and longest line of other files [characters].
_LONGEST, _LONGEST_LINE = 10_000_000, 1_000_000

#: Largest number of files and bytes in an archive, including nested archives.
_MOST_FILES, _MOST_BYTES = 100_000, 2**30

#: Longest archive that is unpacked, whatever sizes it declares [bytes].
_LONGEST_ARCHIVE = 2 * _MOST_BYTES

#: Deepest nesting of folders in an archive: Python walks them recursively.
_MOST_FOLDERS = 100

#: Largest total size of the unpacked archives of a process [bytes].
_MOST_OF_A_PROCESS = 2**33

#: Suffixes of files in an archive that are read into memory, and their largest size [bytes].
_DESCRIPTIONS, _MOST_OF_A_DESCRIPTION = (".xml", ".ssd", ".ssv", ".ssm"), 100_000_000

#: First bytes of a Git LFS pointer.
_POINTER = b"version https://git-lfs.github.com/spec/"

#: Guards the dictionaries below, which threads share.
_LOCK = Lock()

#: Identifies the present content of a file; changes when the file is written.
_Version: TypeAlias = tuple[int, ...]


class _Size(NamedTuple):
    """The size of an unpacked archive, and the outermost archive that it was nested in."""

    files: int
    bytes: int
    outermost: Path
    its_folder: Path


#: Sizes by the folders of unpacked archives.
_sizes: dict[Path, _Size] = {}

#: Digests by versions of files, and folders by the digests of the archives in them.
_digests: dict[_Version, str] = {}
_folders: dict[str, Path] = {}


@contextmanager
def explain_errors(path: Path, what: str) -> Iterator[None]:
    """Turn errors of reading a file into messages that name it and `what` it is: `not a table`."""
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
    """Return True if a folder exists; False also for an invalid name."""
    with suppress(OSError, ValueError):
        return path.is_dir()
    return False


def check_file(path: Path) -> None:
    """Check that a file exists and is a regular one.

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
    """Read a short file as text; `what` describes a file that is not text, for the message.

    Raises:
        InputError: there is no such file, it is too long, or it is not UTF-8.

    """
    check_file(path)
    with explain_errors(path, what), path.open(encoding="utf-8-sig") as file:
        text = file.read(_LONGEST + 1)
        if len(text) > _LONGEST:
            raise ValueError(f"longer than {_LONGEST:,} characters")
        return text


@contextmanager
def open_lines(path: Path, newline: str | None = None) -> Iterator[Iterator[str]]:
    """Open a text in UTF-8 and yield its lines one by one; `newline` as for `open`.

    Raises:
        InputError: there is no such file.
        ValueError: while lines are read, if it is not text, or a line is too long.

    """
    check_file(path)
    with path.open(encoding="utf-8-sig", newline=newline) as file:
        yield _bounded(file)


def _bounded(file: TextIO) -> Iterator[str]:
    while line := file.readline(_LONGEST_LINE):
        if len(line) == _LONGEST_LINE:
            raise ValueError(f"a line is longer than {_LONGEST_LINE:,} characters")
        yield line


class Unpacked(NamedTuple):
    """The folder of an unpacked archive, and the SHA-256 of the archive."""

    folder: Path
    digest: str


def unpack(archive: Path) -> Unpacked:
    """Unpack an FMU or SSP in its present state.

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
    """Return the folder of an archive with a digest, which may have been read in another process.

    Raises:
        InputError: this process has not unpacked it, and the file has changed.

    """
    if digest not in _folders:
        _check_same(archive, unpack(archive).digest, digest)
    return _folders[digest]


def read_archive(archive: Path, digest: str) -> bytes:
    """Read the bytes of an archive that was read before.

    Raises:
        InputError: the file has changed.

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
    if version not in _digests:
        with ZipFile(file) as content:
            # Before the file is read completely, since it may be endless.
            _check_entries(content)
            if (size := os.fstat(file.fileno()).st_size) > _LONGEST_ARCHIVE:
                raise ValueError(f"it is {size:,} bytes long, more than {_LONGEST_ARCHIVE:,}")
            file.seek(0)
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            if digest not in _folders:
                folder = _extracted(archive.resolve(), content)
                if _version_of(file) != version:
                    rmtree(folder, ignore_errors=True)
                    raise InputError(f"{archive}: is being written; try again when it is complete")
                _folders[digest] = folder
        _digests[version] = digest
    return Unpacked(_folders[_digests[version]], _digests[version])


def _version_of(file: BufferedReader) -> _Version:
    # Writing always changes ctime, while mtime can be set to anything.
    status = os.fstat(file.fileno())
    times = status.st_mtime_ns, status.st_ctime_ns
    return status.st_dev, status.st_ino, status.st_size, *times


def _extracted(archive: Path, content: ZipFile) -> Path:
    """Extract an archive into a new folder, unless the total size of archives exceeds a limit."""
    entries = content.infolist()
    files, size = len(entries), sum(entry.file_size for entry in entries)
    around = next((_sizes[folder] for folder in archive.parents if folder in _sizes), None)
    outermost = archive if around is None else around.outermost
    beside = [
        unpacked
        for unpacked in _sizes.values()
        if around and unpacked.its_folder == around.its_folder
    ]
    for what, new, others, most in (
        ("files", files, sum(unpacked.files for unpacked in beside), _MOST_FILES),
        ("bytes", size, sum(unpacked.bytes for unpacked in beside), _MOST_BYTES),
    ):
        if new + others > most:
            raise ValueError(
                f"it unpacks to {new:,} {what}, and {outermost} with its nested archives to "
                f"{new + others:,}, more than {most:,}"
            )
    if (total := size + sum(unpacked.bytes for unpacked in _sizes.values())) > _MOST_OF_A_PROCESS:
        raise ValueError(
            f"it unpacks to {size:,} bytes, and all archives of this process to {total:,}, more "
            f"than {_MOST_OF_A_PROCESS:,}: run them in separate processes"
        )
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
    _sizes[folder] = _Size(files, size, outermost, around.its_folder if around else folder)
    return folder


def _check_entries(content: ZipFile) -> None:
    """Refuse archives that fill the disk or memory, or that tools unpack in different ways."""
    entries = content.infolist()
    if len(entries) > _MOST_FILES:
        raise ValueError(f"it holds {len(entries):,} files, more than {_MOST_FILES:,}")
    if (size := sum(entry.file_size for entry in entries)) > _MOST_BYTES:
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


def _are_same(content: ZipFile, first: ZipInfo, second: ZipInfo) -> bool:
    """Return True if two entries have the same content: some tools list one twice."""
    if first is second:
        return True
    keys = ("filename", "file_size", "CRC")
    alike = all(getattr(first, key) == getattr(second, key) for key in keys)
    return alike and content.read(first) == content.read(second)
