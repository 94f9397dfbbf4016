"""C compilers, and the libraries that they make of the sources of an FMU."""

from __future__ import annotations

import os
import shutil
import signal
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from orchestrator.machine.platforms import TARGETS, Platform, this_machine

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
_LIMIT, LIMIT_OF_ZIG = 120.0, 900.0

#: Universal binaries, as Apple calls libraries for several processors in one file.
_MAGIC_FAT, _MAGIC_64 = 0xCAFEBABE, 0xFEEDFACF

#: Each library begins at a multiple of the largest page, as a power of two.
_ALIGNMENT = 14

#: Heads of the file, of a library in it, and of a library.
_FAT, _ENTRY, _THIN = struct.Struct(">2I"), struct.Struct(">5I"), struct.Struct("<3I")


class Compiler(NamedTuple):
    """A C compiler.

    Attributes:
        name: with its version.
        command: that runs it, with its options.
        targets: its option for each machine, if it makes libraries for several.
        limit: how long it may take [s].

    """

    name: str
    command: Sequence[str]
    targets: Mapping[str, Sequence[str]]
    limit: float = _LIMIT


def machines_compiler() -> str | None:
    """The C compiler of this machine, if it has one."""
    return next(filter(None, map(shutil.which, COMPILERS)), None)


def run_compiler(
    command: Sequence[str], folder: Path | None = None, limit: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a C compiler, and end it with all that it has started if it takes too long.

    Args:
        command: with its arguments.
        folder: that it runs in; None: the current one.
        limit: how long it may take [s]; None: as long as this machine's.

    Raises:
        OSError: it takes longer, or cannot be started.

    """
    limit = _LIMIT if limit is None else limit
    # Ctrl-C is for this process only.
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        errors="replace", start_new_session=True,
    ) as process:  # fmt: skip
        try:
            said, complaints = process.communicate(timeout=limit)
        except BaseException as error:
            if os.name == "posix":
                # After Ctrl-C, Python has waited for it, and it may have ended.
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            if isinstance(error, subprocess.TimeoutExpired):
                raise TimeoutError(f"{command[0]} has not ended after {limit:g} s") from None
            raise
    return subprocess.CompletedProcess(command, process.returncode, said, complaints)


def compiler_for(platforms: Sequence[Platform]) -> Compiler:
    """The one that makes the libraries of all platforms: this machine's own if it can.

    Raises:
        OSError: there is none.

    """
    own, machine = machines_compiler(), this_machine()
    targets = _APPLE if machine in _APPLE else {}
    can = {machine, *targets}
    others = [platform.name for platform in platforms if not can.issuperset(platform.machines)]
    if own is not None and not others and not machine.endswith("-windows"):
        options = _LINUX if machine.endswith("-linux") else ()
        return Compiler(_version_of(own), [own, *options], targets)
    if find_spec("ziglang") is not None:
        # Slow to import, and the command line always imports this module.
        from importlib.metadata import version  # noqa: PLC0415

        command = [sys.executable, "-m", "ziglang", "cc"]
        return Compiler(f"ziglang {version('ziglang')}", command, _ZIG, LIMIT_OF_ZIG)
    names = ", ".join(others or [platform.name for platform in platforms])
    remedy = "pip install 'auv-fmu[native]' brings one"
    if not others and machine.endswith("-linux"):
        remedy = f"install gcc or clang, or {remedy}"
    raise OSError(f"there is no C compiler for {names}: {remedy}")


def _version_of(command: str) -> str:
    process = run_compiler([command, "--version"])
    return process.stdout.partition("\n")[0] or command


def library(
    compiler: Compiler, platform: Platform, name: str, sources: Mapping[str, bytes], main: str
) -> bytes:
    """The library of a platform.

    Args:
        compiler: that can make it.
        platform: that it is for.
        name: of the library, without its ending.
        sources: by the names of their files.
        main: the one that is compiled and includes the others.

    Raises:
        OSError: the compiler fails.

    """
    with TemporaryDirectory(prefix="auv_fmu_native_") as folder:
        for file, content in sources.items():
            Path(folder, file).write_bytes(content)
        # A name without a folder, because the library may hold it.
        made = Path(folder, f"{name}{platform.ending}")
        libraries = []
        for machine in platform.machines:
            target = compiler.targets.get(machine, ())
            size = _SMALL if machine.endswith("-windows") else _NO_TABLES
            options = [*target, *FLAGS, *size, "-o", made.name, main, "-lm"]
            process = run_compiler([*compiler.command, *options], Path(folder), compiler.limit)
            if process.returncode != 0:
                raise OSError(
                    f"{compiler.name} makes no {name} for {machine}: {_complaint(process)}"
                )
            libraries.append(made.read_bytes())
    return libraries[0] if len(libraries) == 1 else universal(libraries)


def check_sources(name: str, sources: Mapping[str, bytes], main: str) -> None:
    """Let this machine's compiler, if it has one, read sources without making a library.

    Args:
        name: of the library.
        sources: by the names of their files.
        main: the one that is compiled and includes the others.

    Raises:
        OSError: it finds a mistake.

    """
    command = machines_compiler()
    if command is None:
        return
    with TemporaryDirectory(prefix="auv_fmu_check_") as folder:
        for file, content in sources.items():
            Path(folder, file).write_bytes(content)
        process = run_compiler([command, *FLAGS, "-fsyntax-only", main], Path(folder))
    if process.returncode != 0:
        raise OSError(f"{command} does not take {name}: {_complaint(process)}")


def _complaint(process: subprocess.CompletedProcess[str]) -> str:
    """The first thing that a compiler complains of."""
    lines = process.stderr.strip().splitlines() or [f"exit status {process.returncode}"]
    return next((line for line in lines if "error" in line), lines[0])


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
