"""One run: scenarios, the wiring of the closed loop, the bundle, result folders.

A `scenario` becomes a system by `wiring`, a run by `preparation`, and rows by `run`, in memory or
in a folder. A `result` contains the rows, the indices and the record.

"""

from pathlib import Path

from orchestrator.machine.errors import InputError, did_you_mean, listed

#: Scenarios that come with the bundle.
SCENARIOS_FOLDER = Path(__file__).parent / "scenarios"


def names_in(folder: Path) -> list[str]:
    """Return the names of the files in a folder of the program, without .toml."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def find_toml(name: str, folder: Path, what: str, files: str) -> Path:
    """Find a file of the program by its name, in any case, or one of the user's by its path.

    Args:
        name: of the file, or its path, which ends in .toml.
        folder: of the files of the program.
        what: kind of file, for the message.
        files: kinds of files that may be given instead of a name, for the message.

    Raises:
        InputError: there is no file with that name.

    """
    if name.endswith(".toml"):
        return Path(name)
    known = {other.casefold(): other for other in names_in(folder)}
    if name.casefold() not in known:
        hint = did_you_mean(name, known.values())
        hint = hint or f"; there are {listed([*known.values()])}, or give {files}"
        raise InputError(f"no {what} {name!r}{hint}")
    return folder / f"{known[name.casefold()]}.toml"
