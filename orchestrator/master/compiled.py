"""stepper.c as a library, compiled once and kept in the user's cache folder."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import sysconfig
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import CDLL
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from subprocess import PIPE, CompletedProcess, Popen, TimeoutExpired
from tempfile import TemporaryDirectory

from orchestrator.machine import cache as user_cache
from orchestrator.machine.children import run_module
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.machine.locks import claimed, process_folder

_SOURCE = Path(__file__).with_name("stepper.c")

#: Products are not contracted with sums: t + h must not depend on the processor.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")

#: C compilers, the first of which is taken that there is. The packaging has the same.
COMPILERS = ("cc", "gcc", "clang")

#: What it is in the user's cache folder.
_KIND = "loop"

#: How long this machine's compiler may take [s], and ziglang, which makes a C library, too.
_LIMIT, LIMIT_OF_ZIG = 60.0, 600.0

#: Libraries that this process has loaded, by cache folders.
_in_use: dict[Path, CDLL] = {}


def kept() -> CDLL | None:
    """The library that was compiled earlier; None: there is none."""
    folder = user_cache.users_folder()
    if folder not in _in_use:
        # What is loaded needs no second look: short runs would take longer for it.
        with suppress(OSError):
            _in_use.update((folder, _loaded(path)) for path in user_cache.kept(_KIND, _key()))
    return _in_use.get(folder)


def made(in_no_time: bool = False) -> CDLL:
    """The library, compiled now.

    Args:
        in_no_time: only by a compiler that takes a tenth of a second.

    Raises:
        InputError: it cannot be; the text says what to do.

    """
    found = _of_the_machine() if in_no_time else compiler()
    if found is None:
        raise InputError(
            "the compiled loop needs a C compiler: install gcc or clang, or `pip install ziglang`"
        )
    try:
        return _made(found)
    except OSError as error:
        raise InputError(f"the loop cannot be compiled: {reason(error)}") from error


#: A compiler: a call with its arguments.
_Compiler = Callable[..., CompletedProcess[str]]


def compiler() -> _Compiler | None:
    """A C compiler: this machine's, or else that of a package; None: there is none."""
    return _of_the_machine() or _zig()


def machines_compiler() -> str | None:
    """The C compiler of this machine, if it has one."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


def _of_the_machine() -> _Compiler | None:
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
    # Ctrl-C is for this process alone.
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


def _zig() -> _Compiler | None:
    """The compiler of the package ziglang, which takes some seconds the first time."""
    if find_spec("ziglang") is None:
        return None
    return lambda *arguments: run_module("ziglang", "cc", *arguments, timeout=LIMIT_OF_ZIG)


def _made(compiler: _Compiler) -> CDLL:
    """The library, compiled and kept.

    Raises:
        OSError: it cannot be compiled, kept or loaded.

    """
    with claimed(user_cache.folder_of(_KIND), wait=True):
        if library := kept():
            # Another process was first.
            return library
        with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
            path = Path(temporary, _name())
            process = compiler(*_FLAGS, str(_SOURCE), "-o", str(path))
            if process.returncode != 0:
                raise OSError(last_line(process.stderr))
            [place] = user_cache.keep(_KIND, _key(), {path.name: path.read_bytes()})
    return _loaded(place)


@cache
def _loaded(place: Path) -> CDLL:
    library = CDLL(str(place))
    if not hasattr(library, "advance"):
        raise OSError(f"{place} has no function advance")
    return library


def _name() -> str:
    return "stepper" + (".dll" if sys.platform == "win32" else ".so")


@cache
def _key() -> str:
    """Of the text, the flags and the kind of machine."""
    digest = sha256(_SOURCE.read_bytes())
    digest.update("\0".join((*_FLAGS, sysconfig.get_platform())).encode())
    return digest.hexdigest()[:16]
