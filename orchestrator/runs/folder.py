"""A folder of results that changes all at once.

Files are written into a hidden folder within it; the folder's ledger then has them take the places
of those of an earlier run. What an earlier run has written and this one does not is removed; files
of others stay as they are. A run that came to no end does not take the place of one that did: it
goes into a folder beside it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, count
from pathlib import Path
from typing import Any

from orchestrator.machine.disk import hold_lock
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.ledger import RECORD, Ledger, Taken, locate

#: Where a run that came to no end goes, if there is a whole result already.
INCOMPLETE = "incomplete"

#: The page that `auv-fmu view` makes of a result, which goes with it.
VIEW = "view.html"


@contextmanager
def replace_files(
    folder: Path,
    names: Iterable[str] = (),
    *,
    force: bool = False,
    keep: Callable[[], bool] = lambda: False,
) -> Iterator[Path]:
    """Give a folder to write files into; at the end they replace the earlier ones.

    An exception in the context leaves the folder as it was.

    Args:
        folder: of the files, made if it does not exist.
        names: that will be written, as far as they are known: they are checked first.
        force: move aside files of the user's that have names of these.
        keep: asked, when they cannot take their places, whether to keep the written files.

    Raises:
        InputError: the folder cannot be written, a name in it is taken by a file of the user's, or
            another run is writing into it.

    """
    with open_ledger(folder, force) as ledger:
        ledger.check(names)
        with ledger.writing() as unfinished:
            try:
                yield unfinished
                publish(ledger)
            except (OSError, MemoryError, Taken) as error:
                rest = _rest(unfinished, folder) if keep() and not ledger.is_moving else ""
                raise InputError(_cannot_write(folder, error, rest)) from error


@contextmanager
def open_ledger(folder: Path, force: bool = False) -> Iterator[Ledger]:
    """Open the ledger of a folder, which is made if it does not exist, and keep other runs out.

    Args:
        folder: to write into.
        force: move aside a file that has the ledger's name but is not one.

    Raises:
        InputError: the folder cannot be written, or another run is writing into it.

    """
    try:
        with make_folder(folder), lock_folder(folder):
            yield Ledger(folder, force)
    except OSError as error:
        raise InputError(_cannot_write(folder, error)) from error


@contextmanager
def make_folder(folder: Path) -> Iterator[None]:
    """Make a folder and those above it; at the end the new ones go again that are empty.

    Raises:
        OSError: it cannot be made.

    """
    whole = folder.absolute()
    # Path.exists raises without permission.
    new = [path for path in (whole, *whole.parents) if not os.path.exists(path)]  # noqa: PTH110
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for path in new:
            # Fails where there is something in it.
            with suppress(OSError):
                path.rmdir()


def inner_folder(folder: Path, *names: str) -> Path:
    """Give a folder in another one.

    Raises:
        InputError: a link leads to it, which could lead anywhere.

    """
    for name in names:
        folder /= name
        if folder.is_symlink():
            raise InputError(
                f"{folder}: is a link; remove it, or choose another folder (--out DIR)"
            )
    return folder


def publish(ledger: Ledger) -> Path:
    """Move the files written into a folder to their place, and return it."""
    unfinished, folder = ledger.unfinished, ledger.folder
    if (place := place_of(unfinished, folder)) != folder:
        place.mkdir(exist_ok=True)
        beside = Ledger(place)
        with beside.writing() as empty:
            empty.rmdir()
            unfinished.rename(empty)
            try:
                _publish(beside)
            except BaseException:
                if not beside.is_moving:
                    empty.rename(unfinished)
                raise
        return place
    is_whole_result = (unfinished / RECORD).is_file() and failure_in(unfinished) is None
    _publish(ledger)
    incomplete = folder / INCOMPLETE
    if is_whole_result and incomplete.is_dir() and not incomplete.is_symlink():
        # What the user has changed of it stays.
        with suppress(Taken, OSError):
            earlier = Ledger(incomplete)
            earlier.remove(earlier.files)
            incomplete.rmdir()
    return folder


def _publish(ledger: Ledger) -> None:
    # Anything but the result of a run, such as an export, replaces no run.
    is_result = (ledger.unfinished / RECORD).is_file()
    ledger.publish([*files_of(ledger.folder), VIEW] if is_result else ())


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Keep other runs out; the lock ends with the process, however it ends."""
    try:
        with hold_lock(folder):
            yield
    except BlockingIOError:
        raise InputError(
            f"another run is writing into {folder}; wait for it, or choose another place (--out)"
        ) from None


def _cannot_write(folder: Path, error: Exception, rest: str = "") -> str:
    if isinstance(error, Taken):
        return f"{error}{rest}"
    hint = "; choose another place (--out)" if isinstance(error, OSError) else ""
    return f"cannot write into {folder}: {reason(error)}{rest}{hint}"


def _rest(unfinished: Path, folder: Path) -> str:
    """Give the written files a visible name; returns where they are, in words."""
    if not unfinished.is_dir():
        return ""
    kept = next(place for place in _beside(folder) if not os.path.lexists(place))
    try:
        # It may say that the run came to its end.
        (unfinished / RECORD).unlink(missing_ok=True)
        unfinished.rename(kept)
    except OSError as error:
        return f"; nor can the files be kept: {reason(error)}"
    return f"; what was written is in {kept}"


def _beside(folder: Path) -> Iterator[Path]:
    """Where a result may go that does not replace another."""
    return (folder / name for name in chain([INCOMPLETE], (f"{INCOMPLETE}-{n}" for n in count(2))))


def place_of(unfinished: Path, folder: Path) -> Path:
    """Where a result goes: beside a whole one, if it is not whole itself."""
    if failure_in(unfinished) and (folder / RECORD).is_file() and not failure_in(folder):
        return next(place for place in _beside(folder) if _has_room(place, unfinished))
    return folder


def _has_room(place: Path, unfinished: Path) -> bool:
    """Whether a result can go into a folder without touching files of the user's."""
    if not os.path.lexists(place):
        return True
    if place.is_symlink() or not place.is_dir():
        return False
    try:
        names = (path.relative_to(unfinished).as_posix() for path in unfinished.rglob("*"))
        Ledger(place).check(name for name in names if (unfinished / name).is_file())
    except Taken:
        return False
    return True


def failure_in(folder: Path) -> str | None:
    """Why the run came to no end whose result is in a folder; None: it did."""
    failure = _record(folder / RECORD).get("failure")
    return None if failure is None else str(failure)


def files_of(folder: Path) -> set[str]:
    """The files that the run says it has written whose record is in a folder."""
    try:
        return set(map(str, _record(folder / RECORD)["files"]))
    except (KeyError, TypeError):
        return set()


def _record(path: Path) -> dict[str, Any]:
    """A record; empty if there is none, or it is not ours."""
    try:
        record = json.loads(locate(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}
