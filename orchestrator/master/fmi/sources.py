"""FMUs without a library for this machine, compiled from their C sources and kept in the cache."""

from __future__ import annotations

import os
import sysconfig
import warnings
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import fmpy
from fmpy.model_description import read_build_description

from orchestrator.machine import cache as user_cache
from orchestrator.machine.compiler import compiler
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.machine.locks import claimed, process_folder
from orchestrator.system.component import Component

#: As the standard of C has it: no product is contracted with a sum, nothing is reordered.
_FLAGS = (
    "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-w",
    "-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX",
)  # fmt: skip

#: The headers of FMI, for FMUs that come without them.
_HEADERS = Path(fmpy.__file__).parent / "c-code"

#: What they are in the user's cache folder.
_CATEGORY = "sources"


class Sources(NamedTuple):
    """What is compiled.

    Attributes:
        files: translation units.
        options: of the compiler, for them.

    """

    files: list[Path]
    options: list[str]


def sources_of(component: Component, folder: Path) -> Sources | None:
    """The sources of an FMU that is unpacked into a folder; None: it has none.

    Raises:
        InputError: their description cannot be read, or names files that are not there.

    """
    place = folder / "sources"
    identifier = component.description.coSimulation.modelIdentifier
    try:
        described: list[Any] = read_build_description(folder, validate=False)
    except Exception as error:
        raise InputError(f"{component.fmu}: buildDescription.xml: {reason(error)}") from error
    sets = [
        one
        for build in (*described, *component.description.buildConfigurations)
        if build.modelIdentifier == identifier
        for one in build.sourceFileSets
    ]
    if not sets:
        files = sorted(place.glob("*.c"))
        return Sources(files, [f"-I{place}"]) if files else None
    files = list(dict.fromkeys(place / name for one in sets for name in one.sourceFiles))
    for file in files:
        if not (file.is_file() and file.resolve().is_relative_to(place.resolve())):
            raise InputError(f"{component.fmu}: holds no sources/{file.relative_to(place)}")
    options = [f"-I{place / name}" for one in sets for name in ("", *one.includeDirectories)]
    for one in sets:
        for definition in one.preprocessorDefinitions:
            if not definition.optional:
                value = "" if definition.value is None else f"={definition.value}"
                options.append(f"-D{definition.name}{value}")
    return Sources(files, list(dict.fromkeys(options)))


def compile_into(component: Component, sources: Sources, binary: Path) -> None:
    """Compile an FMU, or take what was compiled of it before.

    Args:
        component: which.
        sources: its own.
        binary: where its library shall be.

    Raises:
        InputError: there is no compiler, or the compiler refuses them.

    """
    key = _key(component)
    try:
        with claimed(user_cache.folder_of(_CATEGORY), wait=True):
            kept = user_cache.kept(_CATEGORY, key)
            content = next(iter(kept.values())) if kept else _compiled(component, sources)
            if not kept:
                with suppress(OSError):
                    user_cache.keep(_CATEGORY, key, {binary.name: content})
        binary.parent.mkdir(parents=True, exist_ok=True)
        # Other processes may be about to load it.
        new = binary.with_name(f"{binary.name}.{os.getpid()}")
        new.write_bytes(content)
        new.replace(binary)
    except OSError as error:
        raise InputError(f"{component.fmu}: cannot be compiled: {reason(error)}") from error


def check_compiler(component: Component) -> None:
    """Check that an FMU can be compiled here, if it was not before.

    Raises:
        InputError: there is no compiler.

    """
    if compiler() is None and not user_cache.kept(_CATEGORY, _key(component)):
        raise InputError(
            f"{component.fmu}: has no binary for this machine, {fmpy.platform}, and must be "
            "compiled: install gcc or clang, or `pip install ziglang`"
        )


def _compiled(component: Component, sources: Sources) -> bytes:
    check_compiler(component)
    run = compiler()
    assert run is not None
    warnings.warn(
        f"{component.fmu.name} has no binary for this machine, {fmpy.platform}: its C sources are "
        "compiled now, and kept",
        stacklevel=2,
    )
    cpp = ["-lstdc++"] * any(file.suffix != ".c" for file in sources.files)
    with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
        path = Path(temporary, "library")
        process = run(
            *_FLAGS, *sources.options, "-idirafter", str(_HEADERS), *map(str, sources.files),
            "-o", str(path), "-lm", *cpp,
        )  # fmt: skip
        if process.returncode != 0:
            said = process.stderr.splitlines()
            why = next((line for line in said if "error" in line), last_line(process.stderr))
            raise OSError(why.replace(f"{sources.files[0].parent}{os.sep}", ""))
        return path.read_bytes()


def _key(component: Component) -> str:
    """Of the FMU, the flags and the kind of machine."""
    made_of = "\0".join((component.digest, *_FLAGS, sysconfig.get_platform()))
    return sha256(made_of.encode()).hexdigest()[:16]
