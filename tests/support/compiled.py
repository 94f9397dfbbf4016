"""C sources compiled into the libraries of FMUs."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest


@cache
def library_of(source: Path, *options: str) -> bytes:
    """The library of a source; the test is skipped where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    with TemporaryDirectory() as folder:
        library = Path(folder, source.stem)
        common = ("-shared", "-fPIC", "-O1", "-w")
        subprocess.run([compiler, *common, *options, "-o", library, source], check=True)
        return library.read_bytes()
