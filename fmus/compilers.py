"""C compilers, and what they make of the sources of an FMU."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from fmus.platforms import TARGETS, Platform, this_machine
from fmus.python.loader import machines_compiler, run_compiler
from fmus.universal import universal

#: How sources are compiled. Contracted or reordered operations would change numbers.
FLAGS = (
    "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared", "-s",
)  # fmt: skip

#: Nothing here unwinds the stack, but for the C library of Windows, half of a library there, which
#: is compiled with the same options: those for a small one.
_NO_TABLES = ("-fno-unwind-tables", "-fno-asynchronous-unwind-tables")
_SMALL = ("-Os",)

#: For the linker of Linux: no trace of when and where, and no padding to whole pages.
_LINUX = ("-Wl,--build-id=none", "-Wl,-z,noseparate-code")

#: What each compiler takes for the name of a machine: ziglang, and Apple's.
_ZIG = {machine: ("-target", target) for machine, target in TARGETS.items()}
_APPLE = {"x86_64-darwin": ("-arch", "x86_64"), "aarch64-darwin": ("-arch", "arm64")}

#: How long this machine's compiler may take [s], and ziglang, which makes a C library, too.
_LIMIT, _LIMIT_OF_ZIG = 120.0, 900.0


class Compiler(NamedTuple):
    """A C compiler.

    Attributes:
        name: with its version.
        command: that runs it, with options of its own.
        targets: what it is told for each machine, if it makes libraries for several.
        limit: how long it may take [s].

    """

    name: str
    command: Sequence[str]
    targets: Mapping[str, Sequence[str]]
    limit: float = _LIMIT


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
        command = [sys.executable, "-m", "ziglang", "cc"]
        return Compiler(f"ziglang {version('ziglang')}", command, _ZIG, _LIMIT_OF_ZIG)
    names = ", ".join(others or [platform.name for platform in platforms])
    remedy = "pip install 'auv-fmu[native]' brings one"
    if not others and machine.endswith("-linux"):
        remedy = f"install gcc or clang, or {remedy}"
    raise OSError(f"there is no C compiler for {names}: {remedy}")


def _version_of(command: str) -> str:
    process = run_compiler([command, "--version"], None)
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


def _complaint(process: subprocess.CompletedProcess[str]) -> str:
    """The first thing that a compiler complains of."""
    lines = process.stderr.strip().splitlines() or [f"exit status {process.returncode}"]
    return next((line for line in lines if "error" in line), lines[0])
