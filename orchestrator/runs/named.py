"""Files that come with the program have names; any other is named by its path."""

from __future__ import annotations

from pathlib import Path

from orchestrator.machine.errors import InputError, did_you_mean


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
