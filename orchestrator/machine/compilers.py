"""C compilers, and the libraries that they make: for FMUs, or compiled once and loaded here."""

from __future__ import annotations

import os
import shutil
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from ctypes import CDLL
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from orchestrator.machine.cache import category_folder, read_cached, write_cached
from orchestrator.machine.disk import hold_lock, temporary_folder
from orchestrator.machine.platforms import TARGETS, Platform, library_ending, this_machine

#: C compilers: the first one that there is, is taken.
COMPILERS = ("cc", "gcc", "clang")

#: Functions that a compiler would compute itself, rounded in its own way.
ROUNDED = (
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cos", "cosh", "exp", "expm1",
    "log", "log10", "log1p", "log2", "pow", "sin", "sinh", "tan", "tanh",
)  # fmt: skip
#: No contracted operations, and no functions that the compiler computes: both change numbers.
SAME_NUMBERS = ("-ffp-contract=off", *(f"-fno-builtin-{name}" for name in ROUNDED))

#: How sources are compiled.
FLAGS = (
    "-std=c99", "-O2", *SAME_NUMBERS, "-fPIC", "-fvisibility=hidden", "-shared", "-s",
)  # fmt: skip

#: What functions of a library are marked with that others call.
EXPORTED = (
    ("-DEXPORTED=__declspec(dllexport)",)
    if sys.platform == "win32"
    else ('-DEXPORTED=__attribute__((visibility("default")))',)
)

#: The library of mathematics, which is a part of the C library of Windows.
MATHEMATICS = () if sys.platform == "win32" else ("-lm",)

#: Nothing here unwinds the stack, except the C library of Windows, half of a library there, which
#: is compiled with the same options: the ones for a small library.
_NO_TABLES = ("-fno-unwind-tables", "-fno-asynchronous-unwind-tables")
_SMALL = ("-Os",)

#: For the linker of Linux: no trace of when and where, and no padding to whole pages.
_LINUX = ("-Wl,--build-id=none", "-Wl,-z,noseparate-code")

#: What each compiler takes for the name of a machine: ziglang, and Apple's.
_ZIG = {machine: ("-target", target) for machine, target in TARGETS.items()}
_APPLE = {"x86_64-darwin": ("-arch", "x86_64"), "aarch64-darwin": ("-arch", "arm64")}

#: How long this machine's compiler may take [s], and ziglang, which makes a C library, too.
_LIMIT, _LIMIT_OF_ZIG = 120.0, 900.0

#: Universal binaries, as Apple calls libraries for several processors in one file.
_MAGIC_FAT, _MAGIC_64 = 0xCAFEBABE, 0xFEEDFACF

#: Each library begins at a multiple of the largest page, as a power of two.
_ALIGNMENT = 14

#: Heads of the file, of a library in it, and of a library.
_FAT, _ENTRY, _THIN = struct.Struct(">2I"), struct.Struct(">5I"), struct.Struct("<3I")

#: For zig, which else compiles for this very processor.
ANY_PROCESSOR = "-mcpu=baseline"


class Compiler(NamedTuple):
    """A C compiler.

    Attributes:
        command: that runs it, with its options.
        targets: its option for each machine, if it makes libraries for several.
        limit: how long it may take [s]; None: as long as this machine's.
        label: its name with its version; empty: the command is asked.

    """

    command: Sequence[str]
    targets: Mapping[str, Sequence[str]] = {}
    limit: float | None = None
    label: str = ""

    @property
    def name(self) -> str:
        """Name with version."""
        return self.label or _version_of(self.command[0])

    def run(self, *arguments: str, folder: Path | None = None) -> str:
        """Run it in a folder, None: the current one, and return its output.

        If it takes too long it is ended, with all that it has started.

        Raises:
            OSError: it fails, and the text is its first error, or it takes too long.

        """
        limit = _LIMIT if self.limit is None else self.limit
        # Ctrl-C is for this process only.
        with subprocess.Popen(
            [*self.command, *arguments], cwd=folder, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, errors="replace", start_new_session=True,
        ) as process:  # fmt: skip
            try:
                output, complaints = process.communicate(timeout=limit)
            except BaseException as error:
                if os.name == "posix":
                    # After Ctrl-C, Python has waited for it, and it may have ended.
                    with suppress(ProcessLookupError):
                        os.killpg(process.pid, signal.SIGKILL)
                process.kill()
                if isinstance(error, subprocess.TimeoutExpired):
                    raise TimeoutError(
                        f"{self.command[0]} has not ended after {limit:g} s"
                    ) from None
                raise
        if process.returncode != 0:
            lines = complaints.strip().splitlines() or [f"exit status {process.returncode}"]
            raise OSError(next((line for line in lines if "error" in line), lines[-1]))
        return output


def machines_compiler() -> str | None:
    """Return the command of this machine's C compiler, if it has one."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


def own_compiler() -> Compiler | None:
    """Return this machine's C compiler, if it has one: it takes a tenth of a second, zig some."""
    command = machines_compiler()
    return None if command is None else Compiler([command])


def find_compiler() -> Compiler | None:
    """Return a C compiler: this machine's, or else zig; None: there is none."""
    return own_compiler() or zig()


def zig(*options: str) -> Compiler | None:
    """Return the C compiler of the package ziglang, if it is installed."""
    if find_spec("ziglang") is None:
        return None
    # Slow to import, and the command line always imports this module.
    from importlib.metadata import version  # noqa: PLC0415

    # Without -P, Python would import from the current folder.
    command = [sys.executable, "-P", "-m", "ziglang", "cc", *options]
    return Compiler(command, _ZIG, _LIMIT_OF_ZIG, f"ziglang {version('ziglang')}")


def compiler_for(platforms: Sequence[Platform]) -> Compiler:
    """Return the compiler for the libraries of all platforms: this machine's own if it can.

    Raises:
        OSError: there is none.

    """
    own, machine = own_compiler(), this_machine()
    targets = _APPLE if machine in _APPLE else {}
    can = {machine, *targets}
    others = [platform.name for platform in platforms if not can.issuperset(platform.machines)]
    if own is not None and not others and not machine.endswith("-windows"):
        options = _LINUX if machine.endswith("-linux") else ()
        return Compiler([*own.command, *options], targets)
    if compiler := zig():
        return compiler
    names = ", ".join(others or [platform.name for platform in platforms])
    remedy = "pip install 'auv-fmu[native]' brings one"
    if not others and machine.endswith("-linux"):
        remedy = f"install gcc or clang, or {remedy}"
    raise OSError(f"there is no C compiler for {names}: {remedy}")


@cache
def _version_of(command: str) -> str:
    with suppress(OSError):
        return Compiler([command]).run("--version").partition("\n")[0] or command
    return command


@contextmanager
def _written(sources: Mapping[str, bytes]) -> Iterator[Path]:
    """Write sources, by the names of their files, into a temporary folder."""
    with temporary_folder() as folder:
        for file, content in sources.items():
            (folder / file).write_bytes(content)
        yield folder


def compile_library(compiler: Compiler, *arguments: str, folder: Path | None = None) -> bytes:
    """Compile a library of sources and options in a folder, and return its bytes.

    Raises:
        OSError: it cannot be; the text is the first error.

    """
    with temporary_folder() as temporary:
        compiler.run(*arguments, "-o", str(temporary / "library"), folder=folder)
        return (temporary / "library").read_bytes()


def compile_text(compiler: Compiler, text: str, *options: str) -> bytes:
    """Compile a library of the text of one source, and return its bytes.

    Raises:
        OSError: it cannot be; the text is the first error.

    """
    with _written({"source.c": text.encode()}) as folder:
        return compile_library(compiler, str(folder / "source.c"), *options)


def library(
    compiler: Compiler, platform: Platform, name: str, sources: Mapping[str, bytes], main: str
) -> bytes:
    """Compile the library of a platform.

    Args:
        compiler: that can make it.
        platform: that it is for.
        name: of the library, without its ending.
        sources: by the names of their files.
        main: the one that is compiled and includes the others.

    Raises:
        OSError: the compiler fails.

    """
    with _written(sources) as folder:
        # A name without a folder, because the library may hold it.
        made, libraries = folder / f"{name}{platform.ending}", []
        for machine in platform.machines:
            size = _SMALL if machine.endswith("-windows") else _NO_TABLES
            options = [*compiler.targets.get(machine, ()), *FLAGS, *size, "-o", made.name]
            try:
                compiler.run(*options, main, "-lm", folder=folder)
            except OSError as error:
                raise OSError(f"{compiler.name} makes no {name} for {machine}: {error}") from error
            libraries.append(made.read_bytes())
    return libraries[0] if len(libraries) == 1 else universal(libraries)


def check_sources(name: str, sources: Mapping[str, bytes], main: str) -> None:
    """Check sources as for :func:`library`, with this machine's compiler, if it has one.

    Raises:
        OSError: it finds a mistake.

    """
    if compiler := own_compiler():
        try:
            with _written(sources) as folder:
                compiler.run(*FLAGS, "-fsyntax-only", main, folder=folder)
        except OSError as error:
            raise OSError(f"{compiler.command[0]} does not take {name}: {error}") from error


def library_key(*made_of: str, machine: str | None = None) -> str:
    """Return the key of a library in the cache: of its text, its options and its machine."""
    return sha256("\0".join((*made_of, machine or this_machine())).encode()).hexdigest()[:24]


def find_library(category: str, key: str, function: str) -> CDLL | None:
    """Load a library from the cache; None: there is none that has the function."""
    with suppress(OSError):
        for place in read_cached(category, key):
            found = CDLL(str(place))
            if hasattr(found, function):
                return found
    return None


def load_library(category: str, key: str, function: str, make: Callable[[], bytes]) -> CDLL:
    """Load a library from the cache; if it is not there, `make` gives its bytes, which are kept.

    Raises:
        OSError: it cannot be written, or not be loaded.

    """
    if found := find_library(category, key, function):
        return found
    with hold_lock(category_folder(category), wait=True):
        # Another process may have been first.
        if found := find_library(category, key, function):
            return found
        [place] = write_cached(category, key, {f"{category}{library_ending()}": make()})
    return CDLL(str(place))


def universal(libraries: Sequence[bytes]) -> bytes:
    """One file of libraries for different processors.

    Raises:
        ValueError: one is not a 64-bit Mach-O file.

    """
    head, body = _FAT.pack(_MAGIC_FAT, len(libraries)), b""
    begin = _aligned(_FAT.size + len(libraries) * _ENTRY.size)
    for content in libraries:
        magic, processor, model = _THIN.unpack_from(content)
        if magic != _MAGIC_64:
            raise ValueError("not a 64-bit Mach-O file")
        start = _aligned(begin + len(body))
        head += _ENTRY.pack(processor, model, start, len(content), _ALIGNMENT)
        body = body.ljust(start - begin, b"\0") + content
    return head.ljust(begin, b"\0") + body


def _aligned(offset: int) -> int:
    return -(-offset >> _ALIGNMENT) << _ALIGNMENT
