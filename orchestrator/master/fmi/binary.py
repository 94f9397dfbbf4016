"""The library of an FMU, loaded once a process."""

from __future__ import annotations

import glob
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copytree
from tempfile import mkdtemp
from threading import Lock
from typing import Any

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2Error, fmi2Status

from orchestrator.machine.archives import check_place, runs_python
from orchestrator.machine.errors import InputError, reason
from orchestrator.master.fmi.sources import check_compiler, compile_into, sources_of
from orchestrator.master.fmi.surroundings import put_back, within
from orchestrator.system.component import Component

#: How this program names itself in descriptions of FMUs.
_OWN = "auv-fmu "

#: What only FMUs with some capability need, and some of the others lack.
_OPTIONAL = ("FMUstate", "Derivative", "Status", "CancelStep", "DebugLogging")

#: How ELF files of 32 and of 64 bits say where they have what: the place and form of that part of
#: their header, and the length and form of the entries for their segments.
_ELF = {1: (28, "3I5H", 32, "2I8xI"), 2: (32, "2QI5H", 56, "I4xQ16xQ")}

#: The kind of segments that are mapped into memory.
_LOADED = 1


class FMU2OfOthers(FMU2Slave):  # type: ignore[misc]
    """An FMU that may lack functions that its capabilities do not ask for.

    By the beginning of the class's name fmpy knows the version.
    """

    dll: Any

    def _loadFunctions(self) -> None:
        dll = self.dll
        self.dll = _Lenient(dll)
        super()._loadFunctions()
        self.dll = dll

    def _call(self, fname: str, *args: Any) -> Any:
        try:
            result = super()._call(fname, *args)
        finally:
            put_back()
        # fmpy takes what is below all of FMI's statuses for a good one.
        if self._functions[fname].restype is fmi2Status and result < 0:
            raise FMICallException(fname, result)
        return result

    def freeLibrary(self) -> None:
        """Unload the library."""
        super().freeLibrary()
        put_back()


class _Lenient:
    """A library in which optional functions are found that are not there."""

    def __init__(self, dll: Any) -> None:
        self._dll = dll

    def __getattr__(self, name: str) -> Any:
        try:
            return getattr(self._dll, name)
        except AttributeError:
            if not any(part in name for part in _OPTIONAL):
                raise
            return lambda *_: fmi2Error


class Library:
    """A loaded FMU, which serves all its instances in this process.

    Attributes:
        fmu: fmpy's view of it.
        corrupted: whether one of them has ended with fmi2Fatal: FMI then forbids every further
            call, also for the others, even to free them.
        runs_python: whether PythonFMU has made it.
        is_akin: whether it is made by this program or PythonFMU: nothing is left in it of an
            instance, and of each step that it refuses it says that it wants to terminate.
        users: how many there are.

    """

    def __init__(self, component: Component, folder: Path) -> None:
        """Load what has been unpacked into a folder.

        Raises:
            InputError: it cannot be loaded.

        """
        check_place(folder)
        check_binary(component, folder)
        make_binary(component, folder)
        try:
            # fmpy changes the current folder meanwhile, and leaves it so if it fails.
            with within(folder):
                self.fmu = FMU2OfOthers(
                    guid=component.description.guid,
                    modelIdentifier=component.description.coSimulation.modelIdentifier,
                    unzipDirectory=str(folder),
                )
        except Exception as error:
            raise InputError(f"{named(component)} cannot be loaded: {reason(error)}") from error
        finally:
            put_back()
        tool = component.description.generationTool or ""
        self.runs_python = runs_python(folder)
        self.is_akin = tool.startswith(_OWN) or self.runs_python
        self.corrupted, self.users = False, 0


def named(component: Component) -> str:
    """A component and its FMU, for messages."""
    return f"{component.name}: {component.fmu.name}"


def binary_of(component: Component, folder: Path) -> Path:
    """Where the library of an unpacked FMU for this machine is, if it has one."""
    identifier = component.description.coSimulation.modelIdentifier
    name = f"{identifier}{fmpy.sharedLibraryExtension}"
    return Path(folder, "binaries", fmpy.platform, name)


def make_binary(component: Component, folder: Path) -> None:
    """Compile an unpacked FMU that has sources and no library for this machine.

    Raises:
        InputError: it cannot be compiled.

    """
    binary = binary_of(component, folder)
    if not binary.is_file() and (sources := sources_of(component, folder)):
        compile_into(component, sources, binary)


def check_binary(component: Component, folder: Path) -> None:
    """Check that an FMU, unpacked into a folder, has a whole library for this machine, or sources.

    Raises:
        InputError: it has neither.

    """
    binaries = folder / "binaries"
    identifier = component.description.coSimulation.modelIdentifier
    suffix = fmpy.sharedLibraryExtension
    binary = binary_of(component, folder)
    if binary.is_file():
        for path in sorted(binary.parent.iterdir()):
            if path.is_file() and _is_cut_short(path):
                raise InputError(f"{named(component)}: its {path.name} is cut short: get it anew")
        return
    if sources_of(component, folder):
        check_compiler(component)
        return
    others = sorted({path.parent.name for path in binaries.glob(f"*/{glob.escape(identifier)}.*")})
    named_otherwise = sorted(path.name for path in (binaries / fmpy.platform).glob(f"*{suffix}"))
    if others:
        there = f"binaries for {', '.join(others)} only"
    elif named_otherwise:
        there = f"{', '.join(named_otherwise)} instead"
    else:
        there = "no binaries at all"
    raise InputError(
        f"{named(component)} has no {binary.name} for this machine, {fmpy.platform}: it has {there}"
    )


def _is_cut_short(path: Path) -> bool:
    """Whether an ELF file ends before what its header tells of: reading that ends the process.

    The loaders of other systems look for themselves.
    """
    with path.open("rb") as file:
        head = file.read(64).ljust(64, b"\0")
        if head[:4] != b"\x7fELF" or head[4] not in _ELF or head[5] not in (1, 2):
            return False
        order, (start, header, width, segment) = "<>"[head[5] - 1], _ELF[head[4]]
        segments, sections, _, _, length, count, section_length, section_count = struct.unpack_from(
            order + header, head, start
        )
        ends: list[int] = [segments + length * count, sections + section_length * section_count]
        file.seek(segments)
        table = file.read(length * count)
        for at in range(0, len(table) - width + 1, max(length, width)):
            kind, offset, size = struct.unpack_from(order + segment, table, at)
            ends += [offset + size] * (kind == _LOADED)
        return path.stat().st_size < max(ends)


#: Libraries by the folders into which their FMUs are unpacked, for runs in several threads.
_libraries: dict[Path, Library] = {}
_LOCK = Lock()


@contextmanager
def library_of(component: Component, folder: Path) -> Iterator[Library]:
    """The library of an unpacked FMU, for one more instance of it.

    Many libraries hold something of the instances that they have had: each is unloaded with its
    last one, except the ones that are known not to.

    Raises:
        InputError: it cannot be loaded.

    """
    with _LOCK:
        library = _libraries.get(folder)
        if library is None:
            library = Library(component, folder)
        elif library.corrupted:
            # It stays loaded, with all that it has in memory; under another name it is a new one.
            library = Library(component, _copied(folder))
        _libraries[folder] = library
        library.users += 1
    try:
        yield library
    finally:
        with _LOCK:
            library.users -= 1
            if not (library.users or library.corrupted or library.is_akin):
                del _libraries[folder]
                library.fmu.freeLibrary()


def _copied(folder: Path) -> Path:
    try:
        return Path(copytree(folder, mkdtemp(dir=folder.parent), dirs_exist_ok=True))
    except OSError as error:
        raise InputError(f"{folder}: cannot be copied: {reason(error)}") from error
