"""Libraries, machine code and FMUs, made once and kept in the user's cache folder.

All of it is executed, so it is read only from folders and files that no other user can write, and
only if it is unchanged. Nothing is ever overwritten or removed there: a file that was changed is
made again, under another name. Files that were installed with the package, ready for use, are
preferred, and trusted like its code.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from multiprocessing import parent_process
from pathlib import Path
from shutil import rmtree
from stat import S_ISDIR, S_ISLNK, S_ISREG, S_ISVTX
from tempfile import mkdtemp
from typing import TypeVar

from platformdirs import user_cache_path

from orchestrator.machine.disk import hold_lock, process_folder
from orchestrator.machine.operating_system import is_mine, others_write, sync_to_disk

#: Installed files: a folder for each category, in it one for each key.
_READY = Path(__file__).parents[1] / "ready"

#: The file with the digests of the others in a folder, written last: if it exists, all do.
_DIGESTS = ".sha256.json"

T = TypeVar("T")


def users_folder() -> Path:
    """Return the user's cache folder, even if others can write into it."""
    return user_cache_path("auv-fmu", appauthor=False)


def read_cached(category: str, key: str) -> dict[Path, bytes]:
    """Read the files that are kept under a key; empty if there are none, or one was changed.

    Args:
        category: name of a folder for files of one kind.
        key: hash of everything that they were made of.

    """
    with suppress(OSError):
        return {path: path.read_bytes() for path in sorted((_READY / category / key).iterdir())}
    with suppress(OSError):
        for folder in sorted((_root(category) / category).glob(f"{key}-*")):
            if files := _kept_in(folder):
                return files
    return {}


def write_cached(category: str, key: str, files: Mapping[str, bytes]) -> list[Path]:
    """Keep files, given by their names, under a key, and return their paths.

    Raises:
        OSError: they cannot be written.

    """
    folder = Path(mkdtemp(prefix=f"{key}-", dir=category_folder(category)))
    digests = {name: sha256(content).hexdigest() for name, content in files.items()}
    try:
        folder.chmod(0o700)
        for name, content in {**files, _DIGESTS: json.dumps(digests).encode()}.items():
            descriptor = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with open(descriptor, "wb") as file:  # noqa: PTH123
                file.write(content)
                file.flush()
                os.fsync(descriptor)
        sync_to_disk(folder)
    except BaseException:
        rmtree(folder, ignore_errors=True)
        raise
    return [folder / name for name in files]


def made_once(category: str, key: str, make: Callable[[], Mapping[str, bytes]]) -> dict[str, Path]:
    """Return the paths of files by their names; files that are not kept yet are made first.

    Raises:
        OSError: they cannot be written.

    """
    paths = found_or_made(
        category,
        lambda: [*read_cached(category, key)],
        lambda: write_cached(category, key, make()),
    )
    return {path.name: path for path in paths}


def found_or_made(category: str, find: Callable[[], T | None], make: Callable[[], T]) -> T:
    """Return the result of `find`, or else of `make`, which one process at a time calls.

    Raises:
        OSError: the folder of the category cannot be written.

    """
    if result := find():
        return result
    with hold_lock(category_folder(category), wait=True):
        # Another process may have been first.
        return find() or make()


def category_folder(category: str) -> Path:
    """Return the folder of a category, made if it is missing.

    Raises:
        OSError: it cannot be made.

    """
    while True:
        root = _root(category)
        _make(root / category)
        # Another user may have been first.
        if _root(category) == root:
            return root / category


def environment() -> dict[str, str]:
    """Return the environment variables that child processes need to find the same cache."""
    root = _root("")
    return {} if root == users_folder() else {"XDG_CACHE_HOME": str(root.parent)}


def _kept_in(folder: Path) -> dict[Path, bytes]:
    """Read the files that are kept in a folder; empty if one of them was changed."""
    try:
        if not _keeps_others_out(folder.lstat(), above=False):
            return {}
        digests = dict(json.loads(_read(folder / _DIGESTS)))
        if any(Path(name).name != name for name in digests):
            return {}
        files = {folder / name: _read(folder / name) for name in digests}
    except (OSError, ValueError, TypeError, RecursionError):
        return {}
    is_whole = [sha256(content).hexdigest() for content in files.values()] == [*digests.values()]
    return files if is_whole else {}


def _read(path: Path) -> bytes:
    """Read a file that only the user can write.

    Raises:
        OSError: it cannot be read, or another user can write it.

    """
    # A FIFO must not block.
    flags = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with open(os.open(path, os.O_RDONLY | flags), "rb") as file:  # noqa: PTH123
        status = os.fstat(file.fileno())
        if not S_ISREG(status.st_mode) or not is_mine(status) or others_write(status):
            raise PermissionError(f"{path} belongs to, or is writable by, another user")
        return file.read()


def _make(folder: Path) -> None:
    """Make a folder that only the user can enter, whatever the umask, and those above it."""
    if not folder.is_dir():
        _make(folder.parent)
        with suppress(FileExistsError):
            folder.mkdir(0o700)
            folder.chmod(0o700)


def _root(category: str) -> Path:
    """Return the user's cache folder, or one of this process if others could write into that."""
    path = users_folder()
    if not path.is_absolute():
        why = f"{path} is below the current folder: set XDG_CACHE_HOME to an absolute path"
    elif culprit := _open_to_others(path / category, n_within=1 + bool(category)):
        why = (
            f"{culprit} must be a folder that only you can write to: `chmod -R go-w` it, or set "
            "XDG_CACHE_HOME to another"
        )
    else:
        return path
    # Child processes do not repeat the warning.
    if parent_process() is None:
        warnings.warn(f"nothing is cached, because {why}", stacklevel=1)
    return process_folder() / path.name


def _open_to_others(path: Path, n_within: int) -> Path | None:
    """Return the first folder on the way to a folder into which other users can put files.

    Folders above the cache folder may be links or belong to root, or be like /tmp, where users
    cannot rename each other's files.

    Args:
        path: path of the folder.
        n_within: number of its last parts that are not above the cache folder.

    """
    parts = [*reversed(path.parents), path]
    for i, part in enumerate(parts):
        above = i < len(parts) - n_within
        try:
            status = part.lstat()
            if above and S_ISLNK(status.st_mode):
                if not is_mine(status, or_roots=True):
                    return part
                # Fails for links that lead to each other.
                part.stat()
                if culprit := _open_to_others(part.parent / part.readlink(), n_within=0):
                    return culprit
            elif not _keeps_others_out(status, above):
                return part
        except OSError:
            # A missing folder will be made; an unreachable one is reported on writing.
            return None
    return None


def _keeps_others_out(status: os.stat_result, above: bool) -> bool:
    """Return True if only the user can change a folder, which may be above the cache folder."""
    mine = is_mine(status, or_roots=above)
    open_to_others = others_write(status) and not (above and status.st_mode & S_ISVTX)
    # A file in place of a folder is reported when something is written into it.
    return mine and not open_to_others and (above or S_ISDIR(status.st_mode))
