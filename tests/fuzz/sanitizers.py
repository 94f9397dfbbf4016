"""FMUs in C, compiled once more so that they end where memory or arithmetic is misused."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

COMPILER = shutil.which("gcc")

_FLAGS = (
    "-std=c99", "-g", "-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off",
    "-fno-omit-frame-pointer", "-fsanitize=address,undefined", "-fno-sanitize-recover=all",
)  # fmt: skip


def sanitize(folder: Path) -> None:
    """Compile the sources of an unpacked FMU into the place of its library."""
    [library] = folder.glob("binaries/linux64/*.so")
    command = [str(COMPILER), *_FLAGS, "-o", library, "fmi2.c", "-lm", "-pthread"]
    subprocess.run(command, cwd=folder / "sources", check=True)


class Reports:
    """What sanitizers write into a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def environment(self) -> dict[str, str]:
        """Of a process that loads such FMUs."""
        command = [str(COMPILER), "-print-file-name=libasan.so"]
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
