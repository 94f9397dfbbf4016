"""The native loader: what lets an FMU run in a host that is no Python program."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from fmus.compilers import machines_compiler, run_compiler

#: The sources; loader.h says what each is for, and fmi2.c includes all others.
FOLDER = Path(__file__).parent

#: How they are compiled, in their folder, into a library.
FLAGS = (
    "-std=gnu11", "-shared", "-fPIC", "-fvisibility=hidden", "-pthread",
    # Python holds on to it, so it must stay until the process ends.
    "-Wl,-z,nodelete",
    "fmi2.c", "-ldl",
)  # fmt: skip

#: Where PythonFMU's own library goes when the loader takes its name.
_LINUX = "binaries/linux64/"


def compiler() -> str | None:
    """The C compiler, if this is a platform that the loader is for and there is one."""
    return machines_compiler() if sys.platform.startswith("linux") else None


@cache
def compiled() -> bytes:
    """The loader as a shared library.

    Raises:
        OSError: there is no compiler, or it fails.

    """
    command = compiler()
    if command is None:
        raise OSError("the native loader needs Linux and a C compiler; build with --loader plain")
    with TemporaryDirectory(prefix="auv_fmu_loader_") as folder:
        library = Path(folder, "loader.so")
        process = run_compiler(
            [command, "-O2", "-s", "-Wl,--build-id=none", "-o", str(library), *FLAGS], FOLDER
        )
        if process.returncode != 0:
            raise OSError(f"the native loader does not compile: {process.stderr.strip()}")
        return library.read_bytes()


def with_loader(entries: dict[str, bytes]) -> dict[str, bytes]:
    """The entries of an FMU with the loader in the place of PythonFMU's library."""
    changed = dict(entries)
    for name, content in entries.items():
        if name.startswith(_LINUX) and name.endswith(".so"):
            changed[name.replace(".so", "_pythonfmu.so")] = content
            changed[name] = compiled()
    return changed
