"""Libraries, machine code and FMUs, made once and kept in the user's cache folder.

All of it is run, so it is taken only from folders and files that nobody but the user can write,
and only if unchanged since it was kept: the digests of its files are in a separate folder. Nothing
there is ever overwritten or removed. Anything that has changed is made anew, under another name.
What came with the installation, ready for use, is taken first, and trusted like the code beside it.
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
from tempfile import mkdtemp, mkstemp

from platformdirs import user_cache_path

from orchestrator.machine.disk import hold_lock, process_folder
from orchestrator.machine.operating_system import is_mine, others_write, sync_to_disk

#: What came with the installation: a folder for each category, in it one for each key.
_READY = Path(__file__).parents[1] / "ready"

#: The folder of the digests, beside one for each category of what is kept.
_DIGESTS = "digests"

#: Links in a path, as many as Linux follows.
_MOST_LINKS = 40


def users_folder() -> Path:
    """The user's cache folder, even one that others can write into."""
    return user_cache_path("auv-fmu", appauthor=False)


def read_cached(category: str, key: str) -> dict[Path, bytes]:
    """Read the files that are there under a key; empty if they are not as they were kept.

    Args:
        category: of what is kept, a name of a folder.
        key: of all that it was made of.

    """
    with suppress(OSError):
        return {path: path.read_bytes() for path in sorted((_READY / category / key).iterdir())}
    root = _root(category)
    with suppress(OSError):
        for record in sorted((root / _DIGESTS).glob(f"{category}-{key}-*.json")):
            if found := _files(root / category, record):
                return found
    return {}


def made_once(category: str, key: str, make: Callable[[], Mapping[str, bytes]]) -> dict[str, Path]:
    """The places of files by their names, which are made and kept if they are not there.

    Args:
        category: of what is kept, a name of a folder.
        key: of all that they are made of.
        make: gives their contents.

    Raises:
        OSError: they cannot be written.

    """
    found = [*read_cached(category, key)]
    if not found:
        with hold_lock(category_folder(category), wait=True):
            # Another process may have been first.
            found = [*read_cached(category, key)] or write_cached(category, key, make())
    return {path.name: path for path in found}


def environment() -> dict[str, str]:
    """What the environment of processes shall have that work for this one."""
    root = _root(_DIGESTS)
    return {} if root == users_folder() else {"XDG_CACHE_HOME": str(root.parent)}


def category_folder(category: str) -> Path:
    """Give the folder of a category, made if it is not there.

    Raises:
        OSError: it cannot be made.

    """
    return _made(category) / category


def write_cached(category: str, key: str, files: Mapping[str, bytes]) -> list[Path]:
    """Keep files, and give their paths.

    Args:
        category: of what is kept, a name of a folder.
        key: of all that it was made of.
        files: by their names.

    Raises:
        OSError: they cannot be written.

    """
    root = _made(category)
    made = Path(mkdtemp(prefix=f"{key}-", dir=root / category))
    try:
        made.chmod(0o700)
        for name, content in files.items():
            _write(os.open(made / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), content)
        sync_to_disk(made)
        digests = {name: sha256(content).hexdigest() for name, content in files.items()}
        descriptor, record = mkstemp(".json", f"{category}-{key}-", root / _DIGESTS)
        try:
            _write(descriptor, json.dumps({"folder": made.name, "sha256": digests}).encode())
        except BaseException:
            Path(record).unlink()
            raise
    except BaseException:
        rmtree(made, ignore_errors=True)
        raise
    return [made / name for name in files]


def _files(folder: Path, record: Path) -> dict[Path, bytes]:
    """The files that a record tells of; empty if one of them is not as it was kept."""
    try:
        content = json.loads(_read(record))
        name, digests = content["folder"], dict(content["sha256"])
        if any(Path(part).name != part for part in (name, *digests)):
            return {}
        if not _keeps_others_out((folder / name).lstat(), above=False):
            return {}
        found = {folder / name / file: _read(folder / name / file) for file in digests}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}
    whole = [sha256(content).hexdigest() for content in found.values()] == [*digests.values()]
    return found if whole else {}


def _read(path: Path) -> bytes:
    """The content of a file that is the user's.

    Raises:
        OSError: it cannot be read, or another user can write it.

    """
    # A FIFO must not hold us up.
    flags = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with open(os.open(path, os.O_RDONLY | flags), "rb") as file:  # noqa: PTH123
        status = os.fstat(file.fileno())
        if not S_ISREG(status.st_mode) or not is_mine(status) or others_write(status):
            raise PermissionError(f"{path} belongs to, or is writable by, another user")
        return file.read()


def _write(descriptor: int, content: bytes) -> None:
    with open(descriptor, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(descriptor)


def _made(category: str) -> Path:
    """The cache folder, with the folders that are needed in it."""
    while True:
        root = _root(category)
        for folder in (root / category, root / _DIGESTS):
            _make(folder)
        # Another user may have been first.
        if _root(category) == root:
            return root


def _make(folder: Path) -> None:
    """Make a folder that only the user can enter, whatever the umask, and those above it."""
    if not folder.is_dir():
        _make(folder.parent)
        with suppress(FileExistsError):
            folder.mkdir(0o700)
            folder.chmod(0o700)


def _root(category: str) -> Path:
    """The cache folder: the user's, or one of this process where others could write into that."""
    path = users_folder()
    if not path.is_absolute():
        why = f"{path} is below the current folder: set XDG_CACHE_HOME to an absolute path"
    elif culprit := _open_to_others(path / category) or _open_to_others(path / _DIGESTS):
        why = (
            f"{culprit} must be a folder that only you can write to: `chmod -R go-w` it, or set "
            "XDG_CACHE_HOME to another"
        )
    else:
        return path
    # Processes that work for another have nothing to say.
    if parent_process() is None:
        warnings.warn(f"nothing is cached, because {why}", stacklevel=1)
    return process_folder() / path.name


def _open_to_others(path: Path) -> Path | None:
    """The first part of the path of a folder where others could put something of theirs.

    Above the cache folder there may be folders of root's and links, and folders such as /tmp, where
    nobody can move what others have.
    """
    current, parts, links = Path(path.anchor), list(path.parts[1:]), 0
    while parts:
        current /= parts.pop(0)
        try:
            status = current.lstat()
        except OSError:
            # What is not there we make; what cannot be reached is said when it is written.
            return None
        above = len(parts) > 1
        if above and S_ISLNK(status.st_mode):
            links += 1
            if links > _MOST_LINKS or not is_mine(status, or_roots=True):
                return current
            target = current.parent / current.readlink()
            current, parts = Path(target.anchor), [*target.parts[1:], *parts]
        elif not _keeps_others_out(status, above):
            return current
    return None


def _keeps_others_out(status: os.stat_result, above: bool) -> bool:
    """Whether what is in a folder is the user's.

    Args:
        status: of the folder.
        above: it is above the cache folder.

    """
    mine = is_mine(status, or_roots=above)
    open_to_others = others_write(status) and not (above and status.st_mode & S_ISVTX)
    # A file in place of a folder is reported when something is written into it.
    return mine and not open_to_others and (above or S_ISDIR(status.st_mode))
