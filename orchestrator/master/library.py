"""stepper.c as a library, compiled once and kept in the user's cache folder."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from ctypes import CDLL
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from subprocess import CompletedProcess
from tempfile import TemporaryDirectory

from platformdirs import user_cache_path

from orchestrator.errors import InputError, last_line, reason
from orchestrator.system.children import run_module
from orchestrator.system.leftovers import claimed, remove_left

_SOURCE = Path(__file__).with_name("stepper.c")

#: Products are not contracted with sums: t + h must not depend on the processor.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC")

#: C compilers, the first of which is taken that there is.
COMPILERS = ("cc", "gcc", "clang")

#: How the name of a folder of the cache begins in which it is compiled.
_PARTIAL = ".partial-"


def kept() -> CDLL | None:
    """The library that was compiled earlier; None: there is none."""
    try:
        return _loaded(_place())
    except OSError:
        return None


def made(in_no_time: bool = False) -> CDLL:
    """The library, compiled now.

    Args:
        in_no_time: only by a compiler that takes a tenth of a second.

    Raises:
        InputError: it cannot be; the text says what to do.

    """
    compiler = _of_the_machine() or (None if in_no_time else _zig())
    if compiler is None:
        raise InputError(
            "the compiled loop needs a C compiler: install gcc or clang, or `pip install ziglang`"
        )
    try:
        return _made(compiler)
    except OSError as error:
        raise InputError(f"the loop cannot be compiled: {reason(error)}") from error


#: A compiler: a call with its arguments.
_Compiler = Callable[..., CompletedProcess[str]]


def machines_compiler() -> str | None:
    """The C compiler of this machine, if it has one."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


def _of_the_machine() -> _Compiler | None:
    command = machines_compiler()
    if command is None:
        return None
    return lambda *arguments: subprocess.run(
        # Ctrl-C is for this process alone.
        [command, *arguments], capture_output=True, text=True, errors="replace", check=False,
        start_new_session=True,
    )  # fmt: skip


def _zig() -> _Compiler | None:
    """The compiler of the package ziglang, which takes some seconds the first time."""
    if find_spec("ziglang") is None:
        return None
    return lambda *arguments: run_module("ziglang", "cc", *arguments)


def _made(compiler: _Compiler) -> CDLL:
    """The library, compiled beside its place and put there when it is whole.

    Raises:
        OSError: it cannot be compiled, kept or loaded.

    """
    place = _place()
    place.parent.mkdir(parents=True, exist_ok=True)
    with claimed(place.parent, wait=True):
        remove_left(place.parent, f"{_PARTIAL}*")
        if library := kept():
            # Another process was first.
            return library
        with TemporaryDirectory(prefix=_PARTIAL, dir=place.parent) as folder:
            partial = Path(folder, place.name)
            process = compiler(*_FLAGS, str(_SOURCE), "-o", str(partial))
            if process.returncode != 0:
                raise OSError(last_line(process.stderr))
            with partial.open("rb") as file:
                os.fsync(file.fileno())
            partial.replace(place)
    return _loaded(place)


@cache
def _loaded(place: Path) -> CDLL:
    return CDLL(str(place))


def _place() -> Path:
    """Where the library of this text, these flags and this kind of machine is kept."""
    return user_cache_path("auv-fmu", appauthor=False) / "loop" / _name()


@cache
def _name() -> str:
    digest = sha256(_SOURCE.read_bytes())
    digest.update("\0".join((*_FLAGS, sysconfig.get_platform())).encode())
    return digest.hexdigest()[:16] + (".dll" if sys.platform == "win32" else ".so")
