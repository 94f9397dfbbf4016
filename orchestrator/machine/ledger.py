"""What the program has written into a folder: the proof that a file is its own.

A folder that is written into holds a ledger, `.auv-fmu.json`, with the names and digests of what
was written there. A file is replaced or removed only if the ledger names it and its bytes are
those: all others are the user's. What is being written lies in a folder within it whose name is the
ledger's own random token.

Files change all at once. When all are whole and on the disk, the ledger says that they take their
places: from then on they are what the folder holds. If the process is killed meanwhile, the next
one that writes goes on with it, and one that only reads looks where they are.

Where that fails on the way, all files are where they were before. A ledger is believed only if it
belongs to the user or to the owner of the folder that the file is in.

Only the process that has locked the folder may use its ledger.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from hashlib import file_digest
from itertools import count
from pathlib import Path
from shutil import rmtree
from stat import S_ISREG
from typing import NamedTuple
from uuid import uuid4

from orchestrator.machine.disk import sealed, unsealed, write_new, write_whole
from orchestrator.machine.errors import InputError
from orchestrator.machine.operating_system import is_mine, rename_to_new, sync_to_disk

#: The ledger of a folder; what is being written there begins with the same letters.
LEDGER, _UNFINISHED = ".auv-fmu.json", ".auv-fmu-"

#: The record of a result: it leaves first and comes last, so that it is there when everything is.
RECORD = "run.json"

#: So many folders above a file may hold the ledger that names it.
_DEPTH = 4

#: Largest ledger that is read [bytes]: it has some 150 for each file.
_LARGEST = 64 * 2**20

#: Files that make room for new ones, within the folder of what is being written.
_EARLIER = ".earlier"

#: Names and digests.
Digests = dict[str, str]


class Taken(InputError):
    """A file to be written has the name of a file of the user's."""


class Ledger:
    """The ledger of a folder.

    Attributes:
        folder: that it is of.
        token: random, of the ledger.
        unfinished: the folder for what is being written.

    """

    def __init__(self, folder: Path, force: bool = False) -> None:
        """Read it, or begin a new one, and go on with what a killed process has begun.

        Args:
            folder: which exists, and is locked.
            force: move aside files of the user's that are in the way.

        Raises:
            Taken: there is such a file, and it is not moved.
            OSError: the folder cannot be read or written.

        """
        self.folder, self._force = folder, force
        found = self._read()
        self._is_there = found is not None
        found = found or _Content(uuid4().hex, {}, {}, [])
        self.token, self._files = found.identity, found.files
        self._moving, self._leaving = found.moving, found.leaving
        self.unfinished = folder / f"{_UNFINISHED}{self.token}"
        self._earlier = self.unfinished / _EARLIER
        self._partial = folder / f"{_UNFINISHED}{self.token}.json"
        if self._moving:
            self._take_places()

    @property
    def files(self) -> Collection[str]:
        """The names of what was written."""
        return self._files.keys()

    @property
    def is_moving(self) -> bool:
        """Whether files have begun to take their places."""
        return bool(self._moving)

    def owns(self, name: str) -> bool:
        """Whether a file is as it was written."""
        return _digest_in(self.folder, name) in self._known(name)

    def check(self, names: Iterable[str]) -> None:
        """Check that names may be written.

        Args:
            names: of files, from the folder on.

        Raises:
            Taken: it is the user's, and stays where it is.

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

    @contextmanager
    def writing(self) -> Iterator[Path]:
        """A folder to write into, which goes at the end with all that is still in it."""
        is_new = not self._is_there
        if is_new:
            self._write()
        # What a killed process has left.
        self._discard()
        try:
            self.unfinished.mkdir()
            yield self.unfinished
        finally:
            # What has begun to take its place stays, and the next one goes on with it.
            if not self.is_moving:
                self._discard()
                if is_new and not self._files:
                    self._remove()

    def publish(self, old: Iterable[str] = ()) -> None:
        """Move what was written to its place; on failure nothing has changed.

        Args:
            old: names of what goes, if it is ours, because what was written replaces it.

        Raises:
            Taken: a name belongs to a file of the user's.
            OSError: something cannot be written.

        """
        new: Digests = {}
        for path in sorted(self.unfinished.rglob("*")):
            sync_to_disk(path)
            if path.is_file():
                new[path.relative_to(self.unfinished).as_posix()] = sha256_of(path)
        sync_to_disk(self.unfinished)
        leaving = sorted(set(old) & self._files.keys() - new.keys())
        if not new and not leaving:
            return
        # Nothing is lost where the bytes are the same.
        self.check(name for name in new if _digest_in(self.folder, name) != new[name])
        self._moving, self._leaving = new, leaving
        try:
            self._write()
        except OSError:
            self._moving, self._leaving = {}, []
            raise
        try:
            self._take_places()
        except OSError:
            self._forget_moving()
            raise

    @contextmanager
    def changing(self) -> Iterator[Path]:
        """A folder to write into, whose files take their places at the end."""
        with self.writing() as unfinished:
            yield unfinished
            self.publish()

    def remove(self, names: Iterable[str]) -> None:
        """Remove files that are ours, and the folders that are empty then."""
        for name in list(names):
            if self.owns(name):
                (self.folder / name).unlink()
            self._files.pop(name, None)
            for parent in list(Path(name).parents)[:-1]:
                with suppress(OSError):
                    # Fails where there is something in it.
                    (self.folder / parent).rmdir()
        if self._files:
            self._write()
        else:
            self._remove()

    def _known(self, name: str) -> set[str | None]:
        """The digests that a file of ours may have."""
        return {self._files.get(name), self._moving.get(name)} - {None}

    def _taken(self, name: str) -> Path | None:
        """The user's files that are in the way of files to be written."""
        path = self.folder
        for part in Path(name).parts[:-1]:
            path /= part
            # A link could lead out of the folder.
            if path.is_symlink() or (path.exists() and not path.is_dir()):
                return path
        path = self.folder / name
        return path if os.path.lexists(path) and not self.owns(name) else None

    def _take_places(self) -> None:
        """Move what was written to where it belongs; begun again, it goes on."""
        below = self.unfinished.name
        waiting = [name for name in self._moving if _is_plain(self.folder, f"{below}/{name}")]
        self.check(waiting)
        earlier = [*waiting, *filter(self.owns, self._leaving)]
        moved: list[tuple[Path, Path]] = []
        try:
            # The record of a result goes first and comes last: where it is, everything is.
            for name in sorted(earlier, key=lambda name: name != RECORD):
                if os.path.lexists(self.folder / name):
                    _move(self.folder / name, self._earlier / name, moved)
            for name in sorted(waiting, key=lambda name: (name == RECORD, name)):
                if name == RECORD:
                    sync_to_disk(self.folder)
                _move(self.unfinished / name, self.folder / name, moved)
        except OSError:
            for source, target in reversed(moved):
                target.replace(source)
            rmtree(self._earlier, ignore_errors=True)
            raise
        rmtree(self._earlier, ignore_errors=True)
        leaving, self._leaving = self._leaving, []
        self._files |= self._moving
        self._moving = {}
        self._files = {
            name: digest
            for name, digest in self._files.items()
            if os.path.lexists(self.folder / name)
        }
        self.remove(leaving)
        self._discard()
        sync_to_disk(self.folder)

    def _forget_moving(self) -> None:
        """Do not go on with files that are all back where they were."""
        if self._earlier.exists():
            return
        moving, leaving = self._moving, self._leaving
        self._moving, self._leaving = {}, []
        try:
            self._write()
        except OSError:
            # Then the next one tries again.
            self._moving, self._leaving = moving, leaving

    def _read(self) -> _Content | None:
        path = self.folder / LEDGER
        is_believed = not os.path.lexists(path) or _is_believed(path, self.folder)
        found = _content(path) if is_believed else None
        # One without a byte was about to be written.
        if found is None and os.path.lexists(path) and path.lstat().st_size:
            if not self._force:
                raise Taken(
                    f"{path} is damaged or not from auv-fmu, so its own files are unknown; "
                    "choose another place (--out), or let --force move it aside"
                )
            move_aside(path)
        return found

    def _write(self) -> None:
        path = self.folder / LEDGER
        content = _Content(self.token, self._files, self._moving, self._leaving)
        text = sealed(content._asdict())
        if os.path.lexists(path):
            write_whole(path, text, self._partial)
        else:
            # Nobody knows the token yet under which the first one could be written.
            write_new(path, text)
            sync_to_disk(self.folder)
        self._is_there = True

    def _remove(self) -> None:
        (self.folder / LEDGER).unlink(missing_ok=True)
        self._is_there = False

    def _discard(self) -> None:
        """Remove what is not to take its place: under names that nobody else has."""
        rmtree(self.unfinished, ignore_errors=True)
        with suppress(OSError):
            self._partial.unlink()


class _Content(NamedTuple):
    """What a ledger says.

    Attributes:
        identity: the token, by the name that ledgers on disks have for it.
        files: what was written.
        moving: what is about to take its place.
        leaving: what goes when it has.

    """

    identity: str
    files: Digests
    moving: Digests
    leaving: list[str]


def _move(source: Path, target: Path, moved: list[tuple[Path, Path]]) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    source.replace(target)
    moved.append((source, target))


def _content(path: Path) -> _Content | None:
    """What a ledger says; None: it is damaged, or none of ours."""
    try:
        found = path.lstat()
        if not S_ISREG(found.st_mode) or found.st_size > _LARGEST:
            return None
        content = _Content(**unsealed(path.read_text(encoding="utf-8")))
        names = [Path(name) for name in (*content.files, *content.moving, *content.leaving)]
        # One that someone else has written must not lead out of the folder.
        leads_out = any(name.is_absolute() or ".." in name.parts for name in names)
        is_ours = re.fullmatch("[0-9a-f]{32}", content.identity) and not leads_out
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    return content if is_ours else None


def _naming(path: Path) -> Iterator[tuple[Path, str, _Content | None]]:
    """The ledgers of the folders above a file that are believed, and its name from there on."""
    for folder in path.parents[:_DEPTH]:
        ledger = folder / LEDGER
        if os.path.lexists(ledger) and _is_believed(ledger, path.parent):
            yield folder, path.relative_to(folder).as_posix(), _content(ledger)


def _is_believed(ledger: Path, folder: Path) -> bool:
    """Whether a ledger belongs to the user or to the owner of a folder below it.

    Anybody could put one into a folder that all can write, such as /tmp.
    """
    found = ledger.lstat()
    # One that is yet to take its place may be in a folder that is not there yet.
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    return is_mine(found) or found.st_uid == nearest.stat().st_uid


def locate(path: Path) -> Path:
    """Find a file that may be about to take its place."""
    for folder, name, content in _naming(path):
        if content is not None and name in content.moving:
            waiting = folder / f"{_UNFINISHED}{content.identity}" / name
            if waiting.is_file():
                return waiting
    return path


def is_changed(path: Path) -> bool:
    """Whether a file is not what was written there, as far as a ledger tells."""
    for _, name, content in _naming(path):
        if content is None:
            return True
        if digests := {part[name] for part in content[1:3] if name in part}:
            return sha256_of(locate(path)) not in digests
    return False


def sha256_of(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def _digest_in(folder: Path, name: str) -> str | None:
    """The digest of a file in a folder; None: there is none, or a link leads to it."""
    return sha256_of(folder / name) if _is_plain(folder, name) else None


def _is_plain(folder: Path, name: str) -> bool:
    """Whether there is a file in a folder to which no link leads."""
    path = folder
    for part in Path(name).parts:
        path /= part
        if path.is_symlink():
            return False
    return path.is_file()


def move_aside(path: Path) -> Path:
    """Give a file or folder of the user's a name beside its own, which is given back.

    Raises:
        OSError: it cannot be renamed.

    """
    for n in count(1):
        aside = path.with_name(f"{path.name}.~{n}~")
        with suppress(FileExistsError):
            rename_to_new(path, aside)
            return aside
    raise AssertionError
