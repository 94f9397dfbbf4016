"""A folder of results that changes all at once.

Files are written into a hidden folder within it. When all are whole they take the place of those of
an earlier run, `run.json` last: a folder without one holds no whole result. What an earlier run has
written and this one does not is removed; files of others are left alone. A run that came to no end
does not take the place of one that did: it goes into a folder beside it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any
from uuid import uuid4

from orchestrator.errors import InputError, reason

try:
    import fcntl
except ImportError:  # pragma: no cover
    # Not a POSIX system: two runs into one folder are not told apart there.
    fcntl = None  # type: ignore[assignment]

#: The record of a run: what is there when everything is.
RECORD = "run.json"

#: Where a run that came to no end goes, if there is a whole result already.
INCOMPLETE = "incomplete"

#: How the hidden folder's name begins.
_UNFINISHED = ".unfinished-"


@contextmanager
def replaced(folder: Path) -> Iterator[Path]:
    """A folder to write a result into; at the end it takes the place of what was there before.

    An exception in the context leaves the folder as it was.

    Args:
        folder: of the result, made if it does not exist.

    Raises:
        InputError: the folder cannot be written, or another run is writing into it.

    """
    made = not os.path.exists(folder)  # noqa: PTH110  # Path.exists raises without permission
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _locked(folder):
            # Whoever has left these was killed: the lock is ours.
            for left in folder.glob(f"{_UNFINISHED}*"):
                rmtree(left)
            unfinished = Path(mkdtemp(prefix=_UNFINISHED, dir=folder))
            # As umask would have it, and not private.
            unfinished.chmod(folder.stat().st_mode)
            try:
                yield unfinished
                place = place_of(unfinished, folder)
                _publish(unfinished, place)
                if place == folder:
                    _remove(folder / INCOMPLETE)
            except OSError as error:
                raise InputError(
                    f"cannot write into {folder}: {reason(error)}; what was written so far is in "
                    f"{unfinished} until the next run; choose another folder (--out DIR)"
                ) from error
            except BaseException:
                rmtree(unfinished, ignore_errors=True)
                raise
            rmtree(unfinished)
    except OSError as error:
        raise InputError(
            f"cannot write into {folder}: {reason(error)}; choose another folder (--out DIR)"
        ) from error
    finally:
        if made:
            with suppress(OSError):
                # Fails where there is something in it.
                folder.rmdir()


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A file to write instead of another, whose place it takes at the end.

    An exception in the context leaves the other as it was.
    """
    # Ends as the other does: some writers tell the format by that.
    partial = path.with_name(f".partial-{uuid4().hex}{path.suffix}")
    try:
        yield partial
        partial.replace(path)
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other runs out; the lock ends with the process, however it ends."""
    if fcntl is None:
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"another run is writing into {folder}; wait for it, or choose another folder "
                "(--out DIR)"
            ) from None
        except OSError:
            # A file system without locks.
            pass
        yield
    finally:
        os.close(descriptor)


def place_of(unfinished: Path, folder: Path) -> Path:
    """Where a result goes: beside a whole one, if it is not whole itself."""
    if failure_in(unfinished) and (folder / RECORD).is_file() and not failure_in(folder):
        return folder / INCOMPLETE
    return folder


def failure_in(folder: Path) -> str | None:
    """Why the run came to no end whose result is in a folder; None: it did."""
    failure = _record(folder).get("failure")
    return None if failure is None else str(failure)


def _remove(folder: Path) -> None:
    """Take away the result in a folder, and the folder if nothing else is in it."""
    files = files_of(folder)
    for file in files:
        (folder / file).unlink(missing_ok=True)
    for below in (*{(folder / file).parent for file in files} - {folder}, folder):
        with suppress(OSError):
            below.rmdir()


def _publish(unfinished: Path, folder: Path) -> None:
    files = sorted(path.relative_to(unfinished) for path in unfinished.rglob("*") if path.is_file())
    # What is no result of a run, such as an export, takes no run's place.
    is_result = Path(RECORD) in files
    earlier = files_of(folder) if is_result else set()
    for file in files:
        if (folder / file).is_dir():
            raise IsADirectoryError(f"{folder / file} is a folder")
    if is_result:
        (folder / RECORD).unlink(missing_ok=True)
    for file in sorted(files, key=lambda file: file == Path(RECORD)):
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (unfinished / file).replace(folder / file)
    for file in earlier - set(files):
        (folder / file).unlink(missing_ok=True)
        if file.parent != Path() and not any((folder / file.parent).iterdir()):
            (folder / file.parent).rmdir()


def files_of(folder: Path) -> set[Path]:
    """The files that the run has written whose result is in a folder."""
    try:
        files = {Path(name) for name in _record(folder)["files"]}
    except (KeyError, TypeError):
        return set()
    # A record that somebody has edited must not lead out of the folder.
    return {file for file in files if not file.is_absolute() and ".." not in file.parts}


def _record(folder: Path) -> dict[str, Any]:
    """The record in a folder; empty if there is none, or none of ours."""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}
