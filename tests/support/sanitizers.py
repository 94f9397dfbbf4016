"""FMUs and hosts in C that end where memory, arithmetic or threads are misused."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

GCC = shutil.which("gcc")

MEMORY, THREADS = "address,undefined", "thread"

#: Where the tests' hosts are.
_HOSTS = Path(__file__).parents[1] / "fmu"


def _watched(what: str) -> list[str]:
    return ["-O1", "-fno-omit-frame-pointer", f"-fsanitize={what}", "-fno-sanitize-recover"]


def _compile(folder: Path, target: Path, *options: str | Path) -> None:
    command = [str(GCC), "-g", "-o", target, *options, "-pthread", "-ldl", "-lm"]
    subprocess.run(command, cwd=folder, check=True)


def compiled(folder: Path, *options: str) -> Path:
    """Compile the sources of an unpacked FMU into the place of its library."""
    [library] = folder.glob("binaries/linux64/*.so")
    kind = ("-std=c99", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
    _compile(folder / "sources", library, *kind, *options, "fmi2.c")
    return library


def sanitize(folder: Path, what: str = MEMORY) -> Path:
    """The same, with sanitizers."""
    return compiled(folder, *_watched(what))


def sanitized_host(name: str, folder: Path, what: str = MEMORY) -> Path:
    """One of the tests' hosts."""
    _compile(folder, folder / name, *_watched(what), _HOSTS / f"{name}.c")
    return folder / name


class Reports:
    """What sanitizers write into a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def environment(self) -> dict[str, str]:
        """Of a process that loads such FMUs without being compiled so."""
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
