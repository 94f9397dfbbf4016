"""The tests' hosts in C, in a bare root folder, and under sanitizers with FMUs in C."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import fmpy
import pytest

from orchestrator.machine.disk import hold_lock
from support.settings import NAMES

GCC = shutil.which("gcc")

MEMORY, THREADS = "address,undefined", "thread"

_HOSTS = Path(__file__).parents[1] / "fmu"


def host(folder: Path, name: str, *options: str, compiler: str = "cc") -> Path:
    """One of the hosts of tests/fmu, compiled into a folder."""
    strict = ("-Wall", "-Wextra", "-Werror", "-g", "-pthread")
    source = _HOSTS / f"{name}.c"
    command = [compiler, *strict, *options, "-o", folder / name, source, "-ldl"]
    subprocess.run(command, check=True)
    return folder / name


def arguments_of(folder: Path) -> list[str]:
    """Library and resource location of an unpacked FMU, as arguments of a host."""
    [library] = (p for p in folder.glob("binaries/linux64/*.so") if "_pythonfmu" not in p.name)
    return [str(library), (folder / "resources").as_uri()]


def unpacked(fmus: Path, folder: Path, names: Sequence[str] = NAMES) -> list[str]:
    """Libraries and resource locations of all FMUs, or of some, as arguments of a host."""
    places = [Path(fmpy.extract(fmus / f"{name}.fmu", folder / name)) for name in names]
    return [argument for place in places for argument in arguments_of(place)]


def libraries_of(binary: Path) -> list[Path]:
    """The shared libraries that a binary is linked against, and the dynamic loader."""
    output = subprocess.run(["ldd", binary], check=True, capture_output=True, text=True).stdout
    return [Path(word) for word in output.split() if word.startswith("/")]


def bare_root(folder: Path, *binaries: Path) -> list[str]:
    """Prefix of a command that runs in a bare root folder; skips if that is not allowed.

    Args:
        folder: in which binaries find what they are linked against, each library in its place.
        binaries: in the folder, or elsewhere, and then they are copied, too.

    """
    chroot, unshare = (shutil.which(name) or "false" for name in ("chroot", "unshare"))
    command = [chroot] if os.geteuid() == 0 else [unshare, "-r", chroot]
    if subprocess.run([*command, "/", "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("the root folder may not be changed here")
    needed = {library for binary in binaries for library in libraries_of(binary)}
    for path in needed | {binary for binary in binaries if folder not in binary.parents}:
        target = folder / path.relative_to("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return [*command, str(folder)]


# Sanitizers


def _watched(what: str) -> list[str]:
    return ["-O1", "-fno-omit-frame-pointer", f"-fsanitize={what}", "-fno-sanitize-recover"]


def compiled(folder: Path, *options: str) -> Path:
    """Compile the sources of an unpacked FMU into the place of its library."""
    [library] = folder.glob("binaries/linux64/*.so")
    kind = ("-std=c99", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
    command = [str(GCC), "-g", "-o", library, *kind, *options, "fmi2.c", "-lm"]
    subprocess.run(command, cwd=folder / "sources", check=True)
    return library


def sanitize(folder: Path, what: str = MEMORY) -> Path:
    """The same, with sanitizers."""
    return compiled(folder, *_watched(what))


def sanitized(shared: Path, fmus: Path, name: str, what: str = MEMORY) -> Path:
    """An FMU in C, unpacked and compiled with sanitizers once for all workers."""
    folder = shared / what / name
    with hold_lock(shared, wait=True):
        if not folder.exists():
            with TemporaryDirectory(dir=shared) as new:
                sanitize(Path(fmpy.extract(fmus / f"{name}.fmu", new)), what)
                shutil.copytree(new, folder)
    return folder


def sanitized_host(name: str, folder: Path, what: str = MEMORY) -> Path:
    return host(folder, name, *_watched(what), compiler=str(GCC))


class Reports:
    """Reports of sanitizers in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def environment(self) -> dict[str, str]:
        """Variables of a process that loads such FMUs without being compiled so."""
        command = [str(GCC), "-print-file-name=libasan.so"]
        runtime = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        log = f"log_path={self._folder / 'report'}"
        return {
            "LD_PRELOAD": runtime.strip(),
            # Python frees much only with its process.
            "ASAN_OPTIONS": f"{log}:detect_leaks=0",
            "UBSAN_OPTIONS": f"{log}:print_stacktrace=1",
        }

    def __str__(self) -> str:
        return "\n".join(path.read_text() for path in sorted(self._folder.iterdir()))


@contextmanager
def sanitizers() -> Iterator[Reports]:
    """Let processes that are started meanwhile load such FMUs."""
    with TemporaryDirectory(prefix="auv_fmu_reports_") as folder:
        reports = Reports(Path(folder))
        with patch.dict("os.environ", reports.environment()):
            yield reports
