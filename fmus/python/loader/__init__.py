"""The native loader: what lets an FMU run in a host that is no Python program."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

#: The sources; loader.h says what each is for, and fmi2.c includes all others.
FOLDER = Path(__file__).parent

#: How they are compiled, in their folder, into a library.
FLAGS = (
    "-std=gnu11", "-shared", "-fPIC", "-fvisibility=hidden", "-pthread",
    # Python holds on to it, so it must stay until the process ends.
    "-Wl,-z,nodelete",
    "fmi2.c", "-ldl",
)  # fmt: skip

#: C compilers, the first of which is taken that there is. The orchestrator has the same.
COMPILERS = ("cc", "gcc", "clang")

#: Where PythonFMU's own library goes when the loader takes its name.
_LINUX = "binaries/linux64/"


def compiler() -> str | None:
    """The C compiler, if this is a platform that the loader is for and there is one."""
    return machines_compiler() if sys.platform.startswith("linux") else None


def machines_compiler() -> str | None:
    """The C compiler of this machine, if it has one."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


def run_compiler(
    command: Sequence[str], folder: Path | None, limit: float = 120.0
) -> subprocess.CompletedProcess[str]:
    """Run a C compiler, and end it with all that it has started if it takes too long.

    Args:
        command: with its arguments.
        folder: that it runs in; None: the current one.
        limit: how long it may take [s].

    Raises:
        OSError: it takes longer, or cannot be started.

    """
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        errors="replace", start_new_session=True,
    ) as process:  # fmt: skip
        try:
            said, complaints = process.communicate(timeout=limit)
        except BaseException as error:
            if os.name == "posix":
                os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            if isinstance(error, subprocess.TimeoutExpired):
                raise TimeoutError(f"{command[0]} has not ended after {limit:g} s") from None
            raise
    return subprocess.CompletedProcess(command, process.returncode, said, complaints)


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
