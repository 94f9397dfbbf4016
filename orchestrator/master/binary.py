"""The library of an FMU, loaded once a process."""

from __future__ import annotations

import glob
from contextlib import chdir
from pathlib import Path
from shutil import copytree
from tempfile import mkdtemp
from threading import Lock

import fmpy
from fmpy.fmi2 import FMU2Slave

from orchestrator.errors import InputError, reason
from orchestrator.system.component import Component
from orchestrator.system.unpacking import check_place


class Library:
    """A loaded FMU, which serves all its instances in this process.

    Attributes:
        fmu: fmpy's view of it.
        corrupted: whether one of them has ended with fmi2Fatal: FMI then forbids every further
            call, also for the others, even to free them.

    """

    def __init__(self, component: Component, folder: Path) -> None:
        """Load what has been unpacked into a folder.

        Raises:
            InputError: it cannot be loaded.

        """
        check_place(folder)
        identifier = component.description.coSimulation.modelIdentifier
        _check_binary(component, folder / "binaries", identifier)
        try:
            # fmpy changes the current folder meanwhile, and leaves it so if it fails.
            with chdir(Path.cwd()):
                self.fmu = FMU2Slave(
                    guid=component.description.guid,
                    modelIdentifier=identifier,
                    unzipDirectory=str(folder),
                )
        except Exception as error:
            raise InputError(f"{named(component)} cannot be loaded: {reason(error)}") from error
        self.corrupted = False

    def forget(self, folder: Path) -> None:
        """Let the next instance in the folder find an FMU that none has used before."""
        if not self.corrupted:
            with _LOCK:
                del _libraries[folder]
            self.fmu.freeLibrary()


def named(component: Component) -> str:
    """A component and its FMU, for messages."""
    return f"{component.name}: {component.fmu.name}"


def _check_binary(component: Component, binaries: Path, identifier: str) -> None:
    """Check that an FMU has a library for this machine.

    Raises:
        InputError: it has none.

    """
    file = f"{identifier}{fmpy.sharedLibraryExtension}"
    if (binaries / fmpy.platform / file).is_file():
        return
    others = sorted(path.parent.name for path in binaries.glob(f"*/{glob.escape(identifier)}.*"))
    there = f"binaries for {', '.join(others)} alone" if others else "no binaries at all"
    raise InputError(
        f"{named(component)} has no {file} for this machine, {fmpy.platform}: it has {there}"
    )


#: Libraries by the folders into which their FMUs are unpacked, for runs in several threads.
_libraries: dict[Path, Library] = {}
_LOCK = Lock()


def library_of(component: Component, folder: Path) -> Library:
    """The library of an unpacked FMU, loaded once a process, or a copy of a corrupted one."""
    with _LOCK:
        found = _libraries.get(folder)
        if found is None:
            found = Library(component, folder)
        elif found.corrupted:
            # It stays loaded, with all that it has in memory; under another name it is a new one.
            found = Library(component, _copied(folder))
        _libraries[folder] = found
        return found


def _copied(folder: Path) -> Path:
    try:
        return Path(copytree(folder, mkdtemp(dir=folder.parent), dirs_exist_ok=True))
    except OSError as error:
        raise InputError(f"{folder}: cannot be copied: {reason(error)}") from error
