"""The binary of an FMU for this machine: included, or compiled from its C sources."""

from __future__ import annotations

import glob
import os
import re
import struct
import sysconfig
import warnings
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
from fmpy.model_description import read_build_description

from orchestrator.cosim.component import Component, runs_python
from orchestrator.machine import cache
from orchestrator.machine.compilers import compile_library, find_compiler
from orchestrator.machine.disk import hold_lock
from orchestrator.machine.errors import InputError, reason

#: ELF headers of 32 and of 64 bits: offset and format of the part about tables, length and format
#: of the entries for segments.
_ELF = {1: (28, "3I5H", 32, "2I8xI"), 2: (32, "2QI5H", 56, "I4xQ16xQ")}

#: Type of segments that are mapped into memory.
_LOADED = 1

#: Standard C: no product is contracted with a sum, nothing is reordered. No function has a prefix,
#: whether the sources use FMI's headers or, like 20-sim's, their own.
_FLAGS = (
    "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-w",
    "-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX",
    "-DFMI2_FUNCTION_PREFIX=",
)  # fmt: skip

#: FMI's headers, for FMUs without them.
_HEADERS = Path(fmpy.__file__).parent / "c-code"

#: Category of compiled libraries in the cache.
_CATEGORY = "sources"


def name_with_fmu(component: Component) -> str:
    """Name a component and its FMU, for messages."""
    return f"{component.name}: {component.fmu.name}"


def check_place(folder: Path) -> None:
    """Check that an unpacked FMU can find its folder.

    Raises:
        InputError: it cannot; the text says what to do.

    """
    # PythonFMU 0.7 decodes only spaces in the URI of its folder, and otherwise crashes its host.
    # Our loader next to PythonFMU's library decodes the URI for it.
    loader = any(Path(folder, "binaries", fmpy.platform).glob("*_pythonfmu.*"))
    within_drive = folder.relative_to(folder.anchor).as_posix()
    if (
        runs_python(folder)
        and not loader
        and (odd := re.sub(r"[\w./~-]| ", "", within_drive, flags=re.ASCII))
    ):
        raise InputError(
            f"temporary folder {str(folder)!r}: PythonFMU cannot handle {odd[0]!r} in it; set "
            "TMPDIR to another, or build the FMU with --loader native"
        )


def binary_of(component: Component, folder: Path) -> Path:
    """Return the path of an unpacked FMU's library for this machine, which need not exist.

    fmpy uses only the old names of platforms, which FMI 2.0.4 has for x86; some tools use the new
    ones for ARM.
    """
    identifier = component.description.coSimulation.modelIdentifier
    name = f"{identifier}{fmpy.sharedLibraryExtension}"
    platforms = _platform(component), fmpy.platform_tuple
    own, named = (Path(folder, "binaries", platform, name) for platform in platforms)
    return named if named.is_file() else own


def _platform(component: Component) -> str:
    """Return the folder name of this machine's libraries in the FMU's version of FMI."""
    is_newest = component.description.fmiMajorVersion == 3
    return str(fmpy.platform_tuple if is_newest else fmpy.platform)


def make_binary(component: Component, folder: Path) -> None:
    """Compile the missing library of an unpacked FMU from its sources, unless it is cached.

    Raises:
        InputError: there is no compiler, or it fails.

    """
    binary = binary_of(component, folder)
    if binary.is_file() or not (sources := _sources_of(component, folder)):
        return
    key = _key(component)
    try:
        with hold_lock(cache.category_folder(_CATEGORY), wait=True):
            cached = cache.read_cached(_CATEGORY, key)
            content = next(iter(cached.values())) if cached else _compiled(component, sources)
            if not cached:
                with suppress(OSError):
                    cache.write_cached(_CATEGORY, key, {binary.name: content})
        binary.parent.mkdir(parents=True, exist_ok=True)
        # Other processes may load it at the same time.
        new = binary.with_name(f"{binary.name}.{os.getpid()}")
        new.write_bytes(content)
        new.replace(binary)
    except OSError as error:
        why = reason(error).replace(f"{sources.files[0].parent}{os.sep}", "")
        raise InputError(f"{component.fmu}: cannot be compiled: {why}") from error


def check_binary(component: Component, folder: Path | None = None) -> bool:
    """Check that an FMU has a complete library for this machine, or sources.

    Args:
        component: the FMU.
        folder: of the unpacked FMU; None: the folder in this process.

    Returns:
        True if it has a library; False if its sources have to be compiled first.

    Raises:
        InputError: it has neither.

    """
    folder = component.folder if folder is None else folder
    binaries = folder / "binaries"
    identifier = component.description.coSimulation.modelIdentifier
    suffix = fmpy.sharedLibraryExtension
    binary = binary_of(component, folder)
    if binary.is_file():
        for path in sorted(binary.parent.iterdir()):
            if path.is_file() and _is_cut_short(path):
                raise InputError(
                    f"{name_with_fmu(component)}: its {path.name} is truncated: download it again"
                )
        return True
    if _sources_of(component, folder):
        _check_compiler(component)
        return False
    others = sorted({path.parent.name for path in binaries.glob(f"*/{glob.escape(identifier)}.*")})
    named_otherwise = sorted(path.name for path in binary.parent.glob(f"*{suffix}"))
    if others:
        there = f"binaries for {', '.join(others)} only"
    elif named_otherwise:
        there = f"{', '.join(named_otherwise)} instead"
    else:
        there = "no binaries at all"
    raise InputError(
        f"{name_with_fmu(component)} has no {binary.name} for this machine, "
        f"{_platform(component)}: it has {there}"
    )


def _is_cut_short(path: Path) -> bool:
    """Return True for a truncated ELF file: loading it would end the process.

    The loaders of other systems check it themselves.
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


class Sources(NamedTuple):
    """Sources of a library.

    Attributes:
        files: translation units.
        options: of the compiler.

    """

    files: list[Path]
    options: list[str]


def _sources_of(component: Component, folder: Path) -> Sources | None:
    """Return the sources of an unpacked FMU; None: it has no sources.

    Raises:
        InputError: their description cannot be read, or names missing files.

    """
    place = folder / "sources"
    # The list may lack folders of headers.
    beside = sorted({f"-idirafter{header.parent}" for header in place.rglob("*.h")})
    identifier = component.description.coSimulation.modelIdentifier
    try:
        described: list[Any] = read_build_description(folder, validate=False)
    except Exception as error:
        raise InputError(f"{component.fmu}: buildDescription.xml: {reason(error)}") from error
    sets = [
        file_set
        for build in (*described, *component.description.buildConfigurations)
        if build.modelIdentifier == identifier
        for file_set in build.sourceFileSets
    ]
    if not sets:
        files = sorted(place.glob("*.c"))
        return Sources(files, [f"-I{place}", *beside]) if files else None
    files = list(dict.fromkeys(place / name for file_set in sets for name in file_set.sourceFiles))
    for file in files:
        if not (file.is_file() and file.resolve().is_relative_to(place.resolve())):
            raise InputError(f"{component.fmu}: holds no sources/{file.relative_to(place)}")
    options = [
        f"-I{place / name}" for file_set in sets for name in ("", *file_set.includeDirectories)
    ]
    for file_set in sets:
        for definition in file_set.preprocessorDefinitions:
            if not definition.optional:
                value = "" if definition.value is None else f"={definition.value}"
                options.append(f"-D{definition.name}{value}")
    return Sources(files, list(dict.fromkeys([*options, *beside])))


def _check_compiler(component: Component) -> None:
    """Check that an FMU can be compiled here, or was compiled earlier.

    Raises:
        InputError: there is no compiler.

    """
    if find_compiler() is None and not cache.read_cached(_CATEGORY, _key(component)):
        raise InputError(
            f"{component.fmu}: has no binary for this machine, {_platform(component)}, and must be "
            "compiled: install gcc or clang, or `pip install ziglang`"
        )


def _compiled(component: Component, sources: Sources) -> bytes:
    _check_compiler(component)
    compiler = find_compiler()
    assert compiler is not None
    warnings.warn(
        f"{component.fmu.name} has no binary for this machine, {_platform(component)}: its C "
        "sources are compiled now and kept for later runs",
        stacklevel=2,
    )
    cpp = ["-lstdc++"] * any(file.suffix != ".c" for file in sources.files)
    files = map(str, sources.files)
    return compile_library(
        compiler, *_FLAGS, *sources.options, "-idirafter", str(_HEADERS), *files, "-lm", *cpp
    )


def _key(component: Component) -> str:
    """Return the cache key: a digest of the FMU, the compiler flags and the machine."""
    made_of = "\0".join((component.digest, *_FLAGS, sysconfig.get_platform()))
    return sha256(made_of.encode()).hexdigest()[:16]
