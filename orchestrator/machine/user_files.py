"""Files that the user names, read with care: none is waited for, and none is without an end."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import TextIO

from orchestrator.machine.errors import InputError, did_you_mean, reason

#: Longest file that is read as a whole, and longest line of one that is not [characters].
_LONGEST, _LONGEST_LINE = 10_000_000, 1_000_000


@contextmanager
def explained(path: Path, what: str) -> Iterator[None]:
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
    except ValueError as error:
        raise InputError(f"{path}: {what}: {reason(error)}") from error


def is_folder(path: Path) -> bool:
    """Whether there is such a folder; what cannot be the name of one is none."""
    with suppress(OSError, ValueError):
        return path.is_dir()
    return False


def check_file(path: Path) -> None:
    """Check that a file is there that can be read to its end.

    Raises:
        InputError: there is none, or it is a folder, a pipe or a device.

    """
    with explained(path, "not the name of a file"):
        try:
            mode = path.stat().st_mode
        except FileNotFoundError:
            raise InputError(f"{path}: no such file") from None
    if not S_ISREG(mode):
        raise InputError(f"{path}: {'a folder' if S_ISDIR(mode) else 'a pipe or device'}, no file")


def text_of(path: Path, what: str) -> str:
    """The text of a short file.

    Args:
        path: of the file.
        what: it is if it cannot be read as text.

    Raises:
        InputError: there is no such file, it is too long, or no text in UTF-8.

    """
    check_file(path)
    with explained(path, what), path.open(encoding="utf-8-sig") as file:
        text = file.read(_LONGEST + 1)
        if len(text) > _LONGEST:
            raise ValueError(f"longer than {_LONGEST:,} characters")
        return text


@contextmanager
def lines_of(path: Path, newline: str | None = None) -> Iterator[Iterator[str]]:
    """The lines of a text in UTF-8, one by one.

    Args:
        path: of the file.
        newline: as `open` takes it.

    Raises:
        InputError: there is no such file.
        ValueError: while lines are taken, if it is no text, or a line has no end.

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


def path_of(name: str, folder: Path, what: str, files: str) -> Path:
    """The path of a file that comes with the program, by its name, or of any file of the user's.

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
