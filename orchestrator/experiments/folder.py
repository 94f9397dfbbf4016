"""A folder of results that changes all at once.

Files are written into a hidden folder within it. When all are whole and on the disk, that folder
gets another name: from then on its files are the result. They take the places of those of an
earlier run, `run.json` last; if the process is killed meanwhile, whoever comes next goes on with
it. What an earlier run has written and this one does not is removed; files of others are left
alone. A run that came to no end does not take the place of one that did: it goes into a folder
beside it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, count
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any

from orchestrator.errors import InputError, reason
from orchestrator.system.atomic import to_disk
from orchestrator.system.leftovers import claimed

#: The record of a run: what is there when everything is.
RECORD = "run.json"

#: Where a run that came to no end goes, if there is a whole result already.
INCOMPLETE = "incomplete"

#: The hidden folder: how its name begins as long as it is written into, and when it is whole.
_UNFINISHED, _WHOLE = ".unfinished-", ".whole"

#: The record of the result whose place is being taken.
_EARLIER = ".earlier.json"


@contextmanager
def replaced(folder: Path, keep: Callable[[], bool] = lambda: False) -> Iterator[Path]:
    """A folder to write a result into; at the end it takes the place of what was there before.

    An exception in the context leaves the folder as it was.

    Args:
        folder: of the result, made if it does not exist.
        keep: asked, when there is no more room, whether what was written before is to be kept.

    Raises:
        InputError: the folder cannot be written, or another run is writing into it.

    """
    made = not os.path.exists(folder)  # noqa: PTH110  # Path.exists raises without permission
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with locked(folder):
            # Whoever has left these was killed: the lock is ours.
            for left in folder.glob(f"{_UNFINISHED}*"):
                rmtree(left)
            _settle(folder)
            unfinished = Path(mkdtemp(prefix=_UNFINISHED, dir=folder))
            # As umask would have it, and not private.
            unfinished.chmod(folder.stat().st_mode)
            try:
                yield unfinished
                publish(unfinished, folder)
            except (OSError, MemoryError) as error:
                rest = _rest(unfinished, folder) if keep() else ""
                raise InputError(_cannot_write(folder, error, rest)) from error
            finally:
                rmtree(unfinished, ignore_errors=True)
    except OSError as error:
        raise InputError(_cannot_write(folder, error)) from error
    finally:
        if made:
            with suppress(OSError):
                # Fails where there is something in it.
                folder.rmdir()


def publish(unfinished: Path, folder: Path) -> Path:
    """Have a folder that is whole take its place, which is given back."""
    place = place_of(unfinished, folder)
    _publish(unfinished, place)
    return place


def settle(folder: Path) -> None:
    """Go on with what a killed process has begun: files that were taking their places.

    Raises:
        InputError: the folder cannot be written, or a run is writing into it.

    """
    if any((place / _WHOLE).is_dir() for place in (folder, folder / INCOMPLETE)):
        try:
            with locked(folder):
                _settle(folder)
        except OSError as error:
            raise InputError(_cannot_write(folder, error)) from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other runs out; the lock ends with the process, however it ends."""
    try:
        with claimed(folder):
            yield
    except BlockingIOError:
        raise InputError(
            f"another run is writing into {folder}; wait for it, or choose another folder "
            "(--out DIR)"
        ) from None


def _cannot_write(folder: Path, error: Exception, rest: str = "") -> str:
    hint = "; choose another folder (--out DIR)" if isinstance(error, OSError) else ""
    return f"cannot write into {folder}: {reason(error)}{rest}{hint}"


def _rest(unfinished: Path, folder: Path) -> str:
    """Give what was written a name that can be seen; where it is, in words."""
    if not unfinished.is_dir():
        return ""
    names = chain([INCOMPLETE], (f"{INCOMPLETE}-{n}" for n in count(2)))
    kept = next(folder / name for name in names if not (folder / name).exists())
    try:
        # It may say that the run came to its end.
        (unfinished / RECORD).unlink(missing_ok=True)
        unfinished.rename(kept)
    except OSError as error:
        return f"; nor can what was written be kept: {reason(error)}"
    return f"; what was written is in {kept}"


def place_of(unfinished: Path, folder: Path) -> Path:
    """Where a result goes: beside a whole one, if it is not whole itself."""
    if failure_in(unfinished) and (folder / RECORD).is_file() and not failure_in(folder):
        return folder / INCOMPLETE
    return folder


def failure_in(folder: Path) -> str | None:
    """Why the run came to no end whose result is in a folder; None: it did."""
    failure = _record(folder / RECORD).get("failure")
    return None if failure is None else str(failure)


def _publish(unfinished: Path, place: Path) -> None:
    """Make a folder that is whole the result; what fails before changes nothing."""
    for path in unfinished.rglob("*"):
        to_disk(path)
        target = place / path.relative_to(unfinished)
        if target.exists() and target.is_dir() != path.is_dir():
            raise FileExistsError(f"{target} is {'a' if target.is_dir() else 'no'} folder")
    to_disk(unfinished)
    place.mkdir(exist_ok=True)
    unfinished.rename(place / _WHOLE)
    to_disk(place)
    _take_places(place)


def _settle(folder: Path) -> None:
    for place in (folder, folder / INCOMPLETE):
        if (place / _WHOLE).is_dir():
            _take_places(place)


def _take_places(place: Path) -> None:
    """Move files out of the whole folder to where they belong; begun again, it goes on."""
    source = place / _WHOLE
    # What is no result of a run, such as an export, takes no run's place.
    is_result = (source / RECORD).is_file()
    if is_result and (place / RECORD).is_file():
        (place / RECORD).replace(source / _EARLIER)
    for path in sorted(source.rglob("*")):
        file = path.relative_to(source)
        if path.is_file() and file not in (Path(RECORD), Path(_EARLIER)):
            (place / file).parent.mkdir(parents=True, exist_ok=True)
            path.replace(place / file)
    if is_result:
        _remove(place, files_of(source, _EARLIER) - files_of(source))
        if failure_in(source) is None:
            _remove(place / INCOMPLETE, files_of(place / INCOMPLETE))
        to_disk(place)
        (source / RECORD).replace(place / RECORD)
    rmtree(source)


def _remove(folder: Path, files: set[Path]) -> None:
    """Take files away from a folder, and the folders that nothing else is in."""
    for file in files:
        (folder / file).unlink(missing_ok=True)
    folders = {parent for file in files for parent in file.parents} | {Path()}
    for below in sorted(folders, reverse=True):
        with suppress(OSError):
            # Fails where there is something in it.
            (folder / below).rmdir()


def files_of(folder: Path, record: str = RECORD) -> set[Path]:
    """The files that the run has written whose record is in a folder."""
    try:
        files = {Path(name) for name in _record(folder / record)["files"]}
    except (KeyError, TypeError):
        return set()
    # A record that somebody has edited must not lead out of the folder.
    return {file for file in files if not file.is_absolute() and ".." not in file.parts}


def _record(path: Path) -> dict[str, Any]:
    """A record; empty if there is none, or none of ours."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}
