"""One run: scenarios, the wiring of the closed loop, the bundle, result folders.

A scenario becomes a system in `wiring`, is checked in `preparation`, and run by `run`, in memory or
into a folder. A `result` is what comes of it.
"""

from pathlib import Path

from orchestrator.machine.errors import InputError, did_you_mean

#: Scenarios that come with the bundle.
SCENARIOS_FOLDER = Path(__file__).parent / "scenarios"


def names_in(folder: Path) -> list[str]:
    """Return the names of the files that come with the program in a folder, without .toml."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def find_toml(name: str, folder: Path, what: str, files: str) -> Path:
    """Find a file that comes with the program by its name, or one of the user's by its path.

    Args:
        name: of the file, or its path, which ends in .toml.
        folder: of those that come with the program.
        what: kind of file, for the message.
        files: kinds of files that may be given in place of a name, for the message.

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
