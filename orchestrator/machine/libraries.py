"""Libraries of C, compiled once, and kept in the user's cache folder."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from ctypes import CDLL
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from subprocess import CompletedProcess
from tempfile import TemporaryDirectory

from fmpy import platform_tuple, sharedLibraryExtension

from orchestrator.machine.cache import category_folder, read_cached, write_cached
from orchestrator.machine.children import run_module
from orchestrator.machine.compilers import LIMIT_OF_ZIG, machines_compiler, run_compiler
from orchestrator.machine.disk import hold_lock, process_folder
from orchestrator.machine.errors import last_line

#: A compiler: a call with its arguments.
Compiler = Callable[..., CompletedProcess[str]]

#: For ziglang: any processor of this kind, where it would take this very one.
_ANY_PROCESSOR = "-mcpu=baseline"


def find_compiler() -> Compiler | None:
    """Find a C compiler: this machine's, or else the package ziglang's; None: there is none."""
    return find_fast_compiler() or _find_zig()


def find_fast_compiler() -> Compiler | None:
    """Find this machine's C compiler, if it has one: it takes a tenth of a second, zig some."""
    command = machines_compiler()
    return None if command is None else lambda *arguments: run_compiler([command, *arguments])


def find_best_compiler() -> Compiler | None:
    """Find ziglang, whose libraries are faster, or else this machine's compiler."""
    return _find_zig(_ANY_PROCESSOR) or find_fast_compiler()


def _find_zig(*options: str) -> Compiler | None:
    if find_spec("ziglang") is None:
        return None
    return lambda *given: run_module("ziglang", "cc", *options, *given, timeout=LIMIT_OF_ZIG)


def compile_library(compiler: Compiler, *arguments: str) -> bytes:
    """Compile a library of sources and options, and give its bytes.

    Raises:
        OSError: it does not; the text is its first error.

    """
    with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
        path = Path(temporary, "library")
        process = compiler(*arguments, "-o", str(path))
        if process.returncode != 0:
            errors = (line for line in process.stderr.splitlines() if "error" in line)
            raise OSError(next(errors, last_line(process.stderr)))
        return path.read_bytes()


def compile_text(compiler: Compiler, text: str, *options: str) -> bytes:
    """Compile a library of the text of one source, and give its bytes.

    Raises:
        OSError: it does not; the text is its first error.

    """
    with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
        source = Path(temporary, "source.c")
        source.write_text(text, encoding="utf-8")
        return compile_library(compiler, str(source), *options)


def library_key(*made_of: str, machine: str = platform_tuple) -> str:
    """Key of a library in the cache.

    Args:
        made_of: its text and its options.
        machine: that it is for, as FMI 3.0 calls it.

    """
    return sha256("\0".join((*made_of, machine)).encode()).hexdigest()[:24]


def find_library(category: str, key: str, function: str) -> CDLL | None:
    """Load a library that is in the cache; None: there is none.

    Args:
        category: in the cache.
        key: in the category.
        function: that a library must have.

    """
    with suppress(OSError):
        for place in read_cached(category, key):
            library = CDLL(str(place))
            if hasattr(library, function):
                return library
    return None


def load_library(category: str, key: str, function: str, make: Callable[[], bytes]) -> CDLL:
    """Load a library, which is made and kept if it is not in the cache.

    Args:
        category: in the cache.
        key: in the category.
        function: that a library must have.
        make: gives its bytes.

    Raises:
        OSError: it cannot be written, or not be loaded.

    """
    if library := find_library(category, key, function):
        return library
    with hold_lock(category_folder(category), wait=True):
        # Another process may have been first.
        if library := find_library(category, key, function):
            return library
        name = f"{category}{sharedLibraryExtension}"
        [place] = write_cached(category, key, {name: make()})
    return CDLL(str(place))
