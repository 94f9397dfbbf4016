"""The C compiler that there is: the machine's own, or else the one in the package ziglang."""

from __future__ import annotations

import os
import shutil
import signal
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from subprocess import PIPE, CompletedProcess, Popen, TimeoutExpired

from orchestrator.machine.children import run_module

#: C compilers: the first one that there is, is taken. :mod:`fmus.compilers` has the same.
COMPILERS = ("cc", "gcc", "clang")

#: How long this machine's compiler may take [s], and ziglang, which makes a C library, too.
_LIMIT, LIMIT_OF_ZIG = 60.0, 600.0

#: A compiler: a call with its arguments.
Compiler = Callable[..., CompletedProcess[str]]


def compiler() -> Compiler | None:
    """A C compiler: this machine's, or else a package's; None: there is none."""
    return of_the_machine() or _zig()


def machines_compiler() -> str | None:
    """The C compiler of this machine, if it has one."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


def of_the_machine() -> Compiler | None:
    command = machines_compiler()
    if command is None:
        return None
    return lambda *arguments: run_compiler([command, *arguments])


def run_compiler(command: Sequence[str], limit: float | None = None) -> CompletedProcess[str]:
    """Run a C compiler, and end it with all that it has started if it takes too long.

    Args:
        command: with its arguments.
        limit: how long it may take [s]; None: as long as this machine's.

    Raises:
        OSError: it does, or it cannot be started.

    """
    limit = _LIMIT if limit is None else limit
    # Ctrl-C is for this process only.
    with Popen(
        command, stdout=PIPE, stderr=PIPE, text=True, errors="replace", start_new_session=True
    ) as process:
        try:
            said, complaints = process.communicate(timeout=limit)
        except BaseException as error:
            if os.name == "posix":
                os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            if isinstance(error, TimeoutExpired):
                raise TimeoutError(f"{command[0]} has not ended after {limit:g} s") from None
            raise
    return CompletedProcess(command, process.returncode, said, complaints)


def _zig() -> Compiler | None:
    """The compiler of the package ziglang, which takes some seconds the first time."""
    if find_spec("ziglang") is None:
        return None
    return lambda *arguments: run_module("ziglang", "cc", *arguments, timeout=LIMIT_OF_ZIG)
