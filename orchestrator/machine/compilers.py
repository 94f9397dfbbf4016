"""C compilers, the platforms of FMI, and libraries: for FMUs, or compiled once and loaded here."""

from __future__ import annotations

import os
import platform
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

from orchestrator.machine.cache import found_or_made, read_cached, write_cached
from orchestrator.machine.disk import temporary_folder

#: Names of machines in FMI 3.0 and for zig, with the oldest glibc that libraries run on.
TARGETS = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
    "x86_64-darwin": "x86_64-macos",
    "aarch64-darwin": "aarch64-macos",
}

#: Endings of libraries, by the last part of a machine's name.
_ENDINGS = {"linux": ".so", "windows": ".dll", "darwin": ".dylib"}

#: The machines of each platform; several share one universal library. In FMI 2.0.4 darwin64 means
#: x86-64, and other processors have FMI 3.0's names; but hosts on ARM Macs, such as FMPy, look into
#: darwin64.
_MACHINES: Mapping[str, Mapping[str, Sequence[str]]] = {
    "2": {
        "linux64": ("x86_64-linux",),
        "win64": ("x86_64-windows",),
        "darwin64": ("x86_64-darwin", "aarch64-darwin"),
        "aarch64-linux": ("aarch64-linux",),
        "aarch64-darwin": ("aarch64-darwin",),
    },
    "3": {machine: (machine,) for machine in TARGETS},
}


#: Other names of processors.
_PROCESSORS = {"amd64": "x86_64", "arm64": "aarch64"}

#: Commands of C compilers; the first one that is found is used.
COMPILERS = ("cc", "gcc", "clang")

#: Functions that a compiler would evaluate itself, with other rounding than the library's.
ROUNDED = (
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cos", "cosh", "exp", "expm1",
    "log", "log10", "log1p", "log2", "pow", "sin", "sinh", "tan", "tanh",
)  # fmt: skip
#: No contracted operations, and no functions evaluated by the compiler: both change numbers.
SAME_NUMBERS = ("-ffp-contract=off", *(f"-fno-builtin-{name}" for name in ROUNDED))

#: Options for all libraries.
FLAGS = (
    "-std=c99", "-O2", *SAME_NUMBERS, "-fPIC", "-fvisibility=hidden", "-shared", "-s",
)  # fmt: skip

#: Defines the mark of exported functions.
EXPORTED = (
    ("-DEXPORTED=__declspec(dllexport)",)
    if sys.platform == "win32"
    else ('-DEXPORTED=__attribute__((visibility("default")))',)
)

#: Links the mathematical library, which is part of the C library on Windows.
MATHEMATICS = () if sys.platform == "win32" else ("-lm",)

#: Our code never unwinds the stack. On Windows the C library does, is half of the result, and is
#: compiled with the same options: there they ask for a small library.
_NO_TABLES = ("-fno-unwind-tables", "-fno-asynchronous-unwind-tables")
_SMALL = ("-Os",)

#: Options for the linker of Linux: no build id, and no padding to whole pages.
_LINUX = ("-Wl,--build-id=none", "-Wl,-z,noseparate-code")

#: Options that select a machine, for ziglang and for Apple's compiler.
_ZIG = {machine: ("-target", target) for machine, target in TARGETS.items()}
_APPLE = {"x86_64-darwin": ("-arch", "x86_64"), "aarch64-darwin": ("-arch", "arm64")}

#: Time limits [s] of this machine's compiler, and of ziglang, which also builds a C library.
_LIMIT, _LIMIT_OF_ZIG = 120.0, 900.0

#: Universal binaries, as Apple calls libraries for several processors in one file.
_MAGIC_FAT, _MAGIC_64 = 0xCAFEBABE, 0xFEEDFACF

#: Logarithm to the base 2 of the largest page: each library begins at a multiple of a page.
_ALIGNMENT = 14

#: Headers of a universal file, of an entry in it, and of a single library.
_FAT, _ENTRY, _THIN = struct.Struct(">2I"), struct.Struct(">5I"), struct.Struct("<3I")

#: Option for zig, whose default is the processor that it runs on.
ANY_PROCESSOR = "-mcpu=baseline"


# Platforms


class Platform(NamedTuple):
    """A platform that libraries are made for.

    Attributes:
        name: name of its folder in `binaries`.
        machines: keys of :data:`TARGETS`.
        ending: suffix of its library.

    """

    name: str
    machines: Sequence[str]
    ending: str


def platforms(fmi: str, names: str | None = None) -> list[Platform]:
    """Return platforms by their names, each once, in the order of the standard.

    Args:
        fmi: version, `2` or `3`.
        names: names separated by commas, or `all`; None: this machine.

    Raises:
        ValueError: FMI has no such platform.

    """
    known = {
        name: Platform(name, machines, _ENDINGS[machines[0].partition("-")[2]])
        for name, machines in _MACHINES[fmi].items()
    }
    if names is None:
        machine = this_machine()
        own = [platform for platform in known.values() if machine in platform.machines]
        if not own:
            raise ValueError(f"there is no platform for this machine, {machine}")
        return own
    if names == "all":
        return list(known.values())
    chosen = {name.strip() for name in names.split(",")}
    for name in sorted(chosen - known.keys()):
        others = [f"; try --fmi {other}" for other, names in _MACHINES.items() if name in names]
        raise ValueError(
            f"FMI {fmi}.0 has no platform {name!r}; there are {', '.join(known)}, or all"
            f"{''.join(others)}"
        )
    return [platform for name, platform in known.items() if name in chosen]


def this_machine() -> str:
    """Return FMI 3.0's name of this machine, or a similar one for a machine unknown to FMI."""
    processor = platform.machine().lower()
    return f"{_PROCESSORS.get(processor, processor)}-{platform.system().lower()}"


# Compilers


class Compiler(NamedTuple):
    """A C compiler.

    Attributes:
        command: its command with options.
        targets: the options that select each machine, if it compiles for several.
        limit: its time limit [s]; None: that of this machine's compiler.
        label: its name with its version; if empty, it is run to find out.

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
        """Run it in a folder, by default the current one, and return its output.

        If it takes too long, it is killed together with its child processes.

        Raises:
            OSError: it fails, with its first error as the text, or it takes too long.

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
    """Return this machine's C compiler, if any: it takes a tenth of a second, zig some seconds."""
    command = machines_compiler()
    return None if command is None else Compiler([command])


def find_compiler() -> Compiler | None:
    """Return a C compiler: this machine's, or else zig, or None."""
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


def compiler_for(wanted: Sequence[Platform]) -> Compiler:
    """Return a compiler for some platforms: this machine's own if it can compile for all of them.

    Raises:
        OSError: there is none.

    """
    own, machine = own_compiler(), this_machine()
    targets = _APPLE if machine in _APPLE else {}
    can = {machine, *targets}
    others = [platform_.name for platform_ in wanted if not can.issuperset(platform_.machines)]
    if own is not None and not others and not machine.endswith("-windows"):
        options = _LINUX if machine.endswith("-linux") else ()
        return Compiler([*own.command, *options], targets)
    if compiler := zig():
        return compiler
    names = ", ".join(others or [platform_.name for platform_ in wanted])
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
    """Run a compiler with these arguments in a folder, and return the bytes of the library.

    Raises:
        OSError: it fails; the text is its first error.

    """
    with temporary_folder() as temporary:
        compiler.run(*arguments, "-o", str(temporary / "library"), folder=folder)
        return (temporary / "library").read_bytes()


def compile_text(compiler: Compiler, text: str, *options: str) -> bytes:
    """Compile the text of one source, and return the bytes of the library.

    Raises:
        OSError: it fails; the text is its first error.

    """
    with _written({"source.c": text.encode()}) as folder:
        return compile_library(compiler, str(folder / "source.c"), *options)


def library(
    compiler: Compiler, platform: Platform, name: str, sources: Mapping[str, bytes], main: str
) -> bytes:
    """Compile the library of a platform.

    Args:
        compiler: one that can compile for the platform.
        platform: the platform.
        name: file name of the library, without its suffix.
        sources: contents of the sources by their file names.
        main: the source that is compiled and includes the others.

    Raises:
        OSError: the compiler fails.

    """
    with _written(sources) as folder:
        # Without a folder, because the name may be stored in the library.
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
    """Return the key of a library in the cache: a hash of its text, its options and its machine."""
    return sha256("\0".join((*made_of, machine or this_machine())).encode()).hexdigest()[:24]


def find_library(category: str, key: str, function: str) -> CDLL | None:
    """Load a library from the cache; None if there is none that has the function."""
    with suppress(OSError):
        for place in read_cached(category, key):
            loaded = CDLL(str(place))
            if hasattr(loaded, function):
                return loaded
    return None


def load_library(category: str, key: str, function: str, make: Callable[[], bytes]) -> CDLL:
    """Load a library from the cache; if it is missing, keep the bytes that `make` returns.

    Raises:
        OSError: it cannot be written or loaded.

    """

    def made() -> CDLL:
        suffix = _ENDINGS.get(platform.system().lower(), ".so")
        [place] = write_cached(category, key, {f"{category}{suffix}": make()})
        return CDLL(str(place))

    return found_or_made(category, lambda: find_library(category, key, function), made)


def universal(libraries: Sequence[bytes]) -> bytes:
    """Join libraries for different processors into one file.

    Raises:
        ValueError: a library is not a 64-bit Mach-O file.

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
