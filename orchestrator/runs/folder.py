"""Folders of results: files appear all at once and replace only files of this program.

A folder that is written into has a ledger, `.auv-fmu.json`, with the names and digests of its own
files. Only those are replaced or removed, if they are unchanged: all others are the user's.

New files are written into a staging folder within it, named after the ledger's random token. To
publish them, the ledger lists them, the earlier files move into the staging folder, the new ones
move to their places, and the ledger is written again. Until then the earlier files count: a
publication that fails or is killed is undone, at once or by the next process that writes, and
readers find the earlier files in the staging folder. A failed run replaces no complete one: it goes
into `incomplete`.

"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, count
from pathlib import Path
from shutil import rmtree
from stat import S_ISREG
from typing import Any, NamedTuple
from uuid import uuid4

from orchestrator.machine import disk
from orchestrator.machine.disk import move_aside, sha256_of
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.operating_system import is_mine, sync_to_disk

#: The ledger, and the prefix of the staging folder and of the ledger's next version.
LEDGER, _PREFIX = ".auv-fmu.json", ".auv-fmu-"

#: The record of a result. Removed first and written last: if it exists, the result is complete.
RECORD = "run.json"

#: The folder of a failed run beside a complete one, and the page that `auv-fmu view` makes.
INCOMPLETE, VIEW = "incomplete", "view.html"

#: The folder of the earlier files, in the staging folder.
_EARLIER = ".earlier"

#: Number of folders above a file that are searched for a ledger, and its largest size [bytes].
_DEPTH, _LONGEST = 4, 64 * 2**20


class Taken(InputError):
    """A file of the user's has the name of a file to be written."""


class _Content(NamedTuple):
    """Random token of a ledger, digests of its files, and digests of files being published."""

    token: str
    files: dict[str, str]
    moving: dict[str, str]


class Ledger:
    """The ledger of a locked folder.

    Attributes:
        folder: of the ledger.
        token: random, one for each ledger.
        staging: the folder for new files.
        moving: digests of files that are being published, by name.

    """

    def __init__(self, folder: Path, force: bool = False) -> None:
        """Read the ledger or begin a new one, and undo the publication of a killed process.

        Args:
            folder: an existing folder.
            force: move aside files of the user's that are in the way.

        Raises:
            Taken: there is such a file, or the ledger is damaged, and `force` is false.

        """
        self.folder, self._force, self._path = folder, force, folder / LEDGER
        content = _content(self._path) if _is_believed(self._path, folder) else None
        if content is None and os.path.lexists(self._path):
            if not force:
                raise Taken(
                    f"{self._path} is damaged or not from auv-fmu, so its own files are unknown; "
                    "choose another place (--out), or let --force move it aside"
                )
            move_aside(self._path)
        self.token, self._files, self.moving = content or _Content(uuid4().hex, {}, {})
        self.staging = folder / f"{_PREFIX}{self.token}"
        self._partial = folder / f"{_PREFIX}{self.token}.json"
        if self.moving:
            self._undo()

    @property
    def files(self) -> Collection[str]:
        """Names of the files, relative to the folder."""
        return self._files.keys()

    def owns(self, name: str) -> bool:
        """Tell whether a file is unchanged since it was written here."""
        digest = _digest_in(self.folder, name)
        return digest is not None and digest in (self._files.get(name), self.moving.get(name))

    def check(self, names: Iterable[str]) -> None:
        """Check that files may be written; with `force`, move aside what is in the way.

        Raises:
            Taken: a file of the user's is in the way.

        """
        for name in names:
            while taken := self._taken(name):
                if not self._force:
                    what = "not a file that auv-fmu wrote, or was changed since"
                    if taken.is_dir() and not taken.is_symlink():
                        what = "a folder"
                    raise Taken(
                        f"{taken} is {what}: move it, choose another place (--out), or let --force "
                        "move it aside"
                    )
                move_aside(taken)

    def _taken(self, name: str) -> Path | None:
        """Return what is in the way of a file: a file of the user's, or a link."""
        for parent in [*Path(name).parents][-2::-1]:
            path = self.folder / parent
            if path.is_symlink() or (path.exists() and not path.is_dir()):
                return path
        path = self.folder / name
        return path if os.path.lexists(path) and not self.owns(name) else None

    @contextmanager
    def writing(self) -> Iterator[Path]:
        """Provide the staging folder; files that are not published by the end are removed."""
        is_new = not self._path.exists()
        if is_new:
            # It tells the next process that the staging folder is not the user's.
            self._write()
        self._discard()
        try:
            self.staging.mkdir()
            yield self.staging
        finally:
            if not self.moving:
                self._discard()
                if is_new and not self._files:
                    self._path.unlink(missing_ok=True)

    @contextmanager
    def changing(self) -> Iterator[Path]:
        """Provide the staging folder, and publish its files at the end."""
        with self.writing() as staging:
            yield staging
            self.publish()

    def publish(self, replaced: Iterable[str] = ()) -> None:
        """Move the files of the staging folder to their places; on failure nothing has changed.

        Args:
            replaced: names of earlier files to remove, if they are unchanged.

        Raises:
            Taken: a file of the user's is in the way.
            OSError: something cannot be written.

        """
        for path in (*self.staging.rglob("*"), self.staging):
            sync_to_disk(path)
        before = self._files
        new = {name: sha256_of(self.staging / name) for name in _files_in(self.staging)}
        going = [name for name in {*replaced} - new.keys() if self.owns(name)]
        if not new and not going:
            return
        try:
            # Existing files with the same bytes are owned from here on.
            self.moving = new
            self.check(new)
            self._write()
            for name in sorted([*new, *going], key=lambda name: name != RECORD):
                if os.path.lexists(self.folder / name):
                    _move(self.folder / name, self.staging / _EARLIER / name)
            for name in sorted(new, key=lambda name: (name == RECORD, name)):
                _move(self.staging / name, self.folder / name)
            for folder in {parent for name in new for parent in Path(name).parents}:
                sync_to_disk(self.folder / folder)
            files = (before | new).items()
            self._files = {name: d for name, d in files if os.path.lexists(self.folder / name)}
            self.moving = {}
            # From here on the new files count.
            self._write()
        except BaseException:
            self._files, self.moving = before, new
            self._undo()
            raise
        self._discard()
        self._remove_empty_folders(going)

    def set_aside(self, place: Path, replaced: Iterable[str]) -> None:
        """Publish the staging folder by renaming it, and remove the files that it replaces.

        Raises:
            OSError: it cannot be renamed.

        """
        self.staging.rename(place)
        with suppress(OSError):
            # Otherwise its files are the user's.
            names = (f"{place.name}/{name}" for name in _files_in(place))
            self._files |= {name: sha256_of(self.folder / name) for name in names}
            self.remove(replaced)

    def remove(self, names: Iterable[str]) -> None:
        """Remove files that are unchanged, and folders that are empty then."""
        names = list(names)
        for name in names:
            if self.owns(name):
                (self.folder / name).unlink()
            self._files.pop(name, None)
        self._remove_empty_folders(names)
        if self._files:
            self._write()
        else:
            self._path.unlink(missing_ok=True)

    def _undo(self) -> None:
        """Restore the state before a publication."""
        if self.staging.is_dir() and not self.staging.is_symlink():
            for name in self.moving:
                is_out = _digest_in(self.folder, name) == self.moving[name]
                if is_out and not (_has_link(self.staging, name) or (self.staging / name).exists()):
                    _move(self.folder / name, self.staging / name)
            for name in _files_in(self.staging / _EARLIER):
                self.check([name])
                _move(self.staging / _EARLIER / name, self.folder / name)
            rmtree(self.staging / _EARLIER, ignore_errors=True)
        self.moving = {}
        with suppress(OSError):
            # If it fails, the next process finds nothing left to undo.
            self._write()

    def _write(self) -> None:
        record = {"identity": self.token, "files": self._files, "moving": self.moving}
        disk.write_whole(self._path, disk.sealed(record), self._partial)

    def _remove_empty_folders(self, names: Iterable[str]) -> None:
        for parent in (parent for name in names for parent in [*Path(name).parents][:-1]):
            with suppress(OSError):
                # Fails if it is not empty.
                (self.folder / parent).rmdir()

    def _discard(self) -> None:
        """Remove the staging folder and partial ledgers, which only this program makes."""
        rmtree(self.staging, ignore_errors=True)
        # A process that was killed when it began a ledger has left one with another token.
        for partial in self.folder.glob(f"{_PREFIX}{'[0-9a-f]' * 32}.json"):
            with suppress(OSError):
                partial.unlink()


def _move(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    source.replace(target)


def _has_link(folder: Path, name: str) -> bool:
    """Tell whether a file in a folder, or a folder on the way to it, is a link."""
    path = Path(name)
    return any((folder / part).is_symlink() for part in (path, *[*path.parents][:-1]))


def _digest_in(folder: Path, name: str) -> str | None:
    """Digest of a file in a folder; None: there is none, or a link leads to it."""
    is_there = not _has_link(folder, name) and (folder / name).is_file()
    return sha256_of(folder / name) if is_there else None


def _files_in(folder: Path) -> list[str]:
    """Names of the files in a folder that are not reached by links."""
    if folder.is_symlink():
        return []
    names = [path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*"))]
    return [name for name in names if (folder / name).is_file() and not _has_link(folder, name)]


def _content(path: Path) -> _Content | None:
    """Read a ledger; None: there is none, or it is damaged, or not from this program."""
    try:
        status = path.lstat()
        if not S_ISREG(status.st_mode) or status.st_size > _LONGEST:
            return None
        record = disk.unsealed(path.read_text(encoding="utf-8"))
        content = _Content(record["identity"], dict(record["files"]), dict(record["moving"]))
        names = [Path(name) for name in (*content.files, *content.moving)]
        # A forged one must not lead out of the folder.
        leads_out = any(name.is_absolute() or ".." in name.parts for name in names)
        return content if re.fullmatch("[0-9a-f]{32}", content.token) and not leads_out else None
    except (OSError, ValueError, TypeError, LookupError, RecursionError):
        return None


def _is_believed(ledger: Path, folder: Path) -> bool:
    """Tell whether a ledger belongs to the user, or to the owner of a folder below it.

    Anyone could put one into a folder that all can write, such as /tmp.

    """
    if not os.path.lexists(ledger):
        return False
    # The folder itself may have moved into the staging folder.
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    return is_mine(ledger.lstat()) or ledger.lstat().st_uid == nearest.stat().st_uid


def _ledgers_of(path: Path) -> Iterator[tuple[Path, str, _Content | None]]:
    """Find the ledgers that may name a file: their folders, its name there, and their contents."""
    for folder in path.parents[:_DEPTH]:
        if _is_believed(folder / LEDGER, path.parent):
            yield folder, path.relative_to(folder).as_posix(), _content(folder / LEDGER)


def locate(path: Path) -> Path:
    """Return the path of a file, also during a publication: new files do not count yet."""
    for folder, name, content in _ledgers_of(path):
        if content is not None and content.moving:
            staging = folder / f"{_PREFIX}{content.token}"
            is_in_place = name in content.moving and not (staging / name).exists()
            if (staging / _EARLIER / name).is_file() or (is_in_place and staging.is_dir()):
                return staging / _EARLIER / name
    return path


def is_changed(path: Path) -> bool:
    """Tell whether a file was changed since it was written, if a ledger lists it."""
    for _, name, content in _ledgers_of(path):
        if content is None:
            return True
        if name in content.files:
            return sha256_of(locate(path)) != content.files[name]
    return False


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Make a folder if there is none, and keep other runs out; new folders go if they stay empty.

    Raises:
        InputError: the folder cannot be made or written, or another run is writing into it.

    """
    absolute = folder.absolute()
    # Path.exists raises without permission.
    new = [path for path in (absolute, *absolute.parents) if not os.path.exists(path)]  # noqa: PTH110
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with disk.hold_lock(folder):
            yield
    except BlockingIOError:
        raise InputError(
            f"another run is writing into {folder}; wait for it, or choose another place (--out)"
        ) from None
    except OSError as error:
        raise InputError(_cannot_write(folder, error)) from error
    finally:
        for path in new:
            with suppress(OSError):
                path.rmdir()


@contextmanager
def open_ledger(folder: Path, force: bool = False) -> Iterator[Ledger]:
    """Lock a folder, and open its ledger: :func:`locked_folder` and :class:`Ledger`."""
    with locked_folder(folder):
        yield Ledger(folder, force)


@contextmanager
def replace_files(
    folder: Path,
    names: Iterable[str] = (),
    *,
    force: bool = False,
    keep: Callable[[], bool] = lambda: False,
) -> Iterator[Path]:
    """Provide a folder to write files into; at the end they replace the earlier ones.

    An exception in the context leaves the folder as it was.

    Args:
        folder: of the files, made if it does not exist.
        names: files that will be written, if they are known: they are checked first.
        force: move aside files of the user's with these names.
        keep: asked, if the files cannot be published, whether to keep them elsewhere.

    Raises:
        InputError: the folder cannot be written, a file of the user's is in the way, or another run
            is writing into it.

    """
    with open_ledger(folder, force) as ledger:
        ledger.check(names)
        with ledger.writing() as staging:
            try:
                yield staging
                publish(ledger)
            except (OSError, MemoryError, Taken) as error:
                rest = _keep_files(ledger) if keep() and not ledger.moving else ""
                raise InputError(_cannot_write(folder, error, rest)) from error


def _cannot_write(folder: Path, error: Exception, rest: str = "") -> str:
    if isinstance(error, Taken):
        return f"{error}{rest}"
    why, hint = reason(error), ""
    if isinstance(error, OSError):
        hint = "; choose another place (--out)"
        if error.filename in (str(folder), str(folder.absolute())):
            # Its name is in the message already.
            why = error.strerror or why
    return f"cannot write into {folder}: {why}{rest}{hint}"


def _keep_files(ledger: Ledger) -> str:
    """Keep files that cannot be published, and tell where they are."""
    if not ledger.staging.is_dir():
        return ""
    try:
        # It may state that the run was completed.
        (ledger.staging / RECORD).unlink(missing_ok=True)
        place = ledger.staging.rename(_free_place(ledger.folder))
    except OSError as error:
        return f"; nor can the files be kept: {reason(error)}"
    return f"; what was written is in {place}"


def publish(ledger: Ledger) -> Path:
    """Move the files of the staging folder to their places, and return the folder."""
    record, earlier = _record(ledger.staging), _record(ledger.folder)
    place = place_of(ledger)
    incomplete = [name for name in ledger.files if re.match(rf"{INCOMPLETE}(-\d+)?/", name)]
    if place != ledger.folder:
        ledger.set_aside(place, incomplete)
    elif record:
        names = earlier.get("files")
        replaced = [*map(str, names if isinstance(names, list) else ()), VIEW]
        ledger.publish(replaced if record.get("failure") else replaced + incomplete)
    else:
        # Only a run replaces the result of a run: an export does not.
        ledger.publish()
    return place


def place_of(ledger: Ledger) -> Path:
    """Return the folder for the staged result: a failed one does not replace a complete one."""
    staged, earlier = _record(ledger.staging), _record(ledger.folder)
    has_complete = (ledger.folder / RECORD).is_file() and not earlier.get("failure")
    return _free_place(ledger.folder) if has_complete and staged.get("failure") else ledger.folder


def _free_place(folder: Path) -> Path:
    """Return the place for a result that must not replace another one."""
    names = chain([INCOMPLETE], (f"{INCOMPLETE}-{n}" for n in count(2)))
    return next(folder / name for name in names if not os.path.lexists(folder / name))


def _record(folder: Path) -> dict[str, Any]:
    """Read the record of a result; empty: there is none, or it is not from this program."""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}


def inner_folder(folder: Path, *names: str) -> Path:
    """Return a folder within another one; an InputError refuses links, which may lead anywhere."""
    for name in names:
        folder /= name
        if folder.is_symlink():
            raise InputError(
                f"{folder}: is a link; remove it, or choose another folder (--out DIR)"
            )
    return folder
