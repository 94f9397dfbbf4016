"""The bundle: every FMU and the SSP of the closed loop, built when missing or stale.

`auv-fmu build` writes it where the user wants it. Runs use FMUs of their own in the user's cache
folder, one folder for each version of the sources, so that nothing appears where they are called.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from platformdirs import user_cache_path

from orchestrator.errors import InputError, last_line, reason
from orchestrator.experiments.bill_of_materials import (
    BILL,
    CHECKSUMS,
    bill,
    checksums,
    digest_of,
)
from orchestrator.experiments.folder import whole
from orchestrator.experiments.wiring import closed_loop
from orchestrator.system.ssp.writing import ssp_bytes

#: Where `auv-fmu build` writes unless another folder is named.
DEFAULT_FOLDER = Path("fmus", "dist")

#: The archive of the closed loop, and what was built beside it, from what.
ARCHIVE, MANIFEST = "auv.ssp", "build.json"

#: Packages that the FMUs are made of.
_SOURCES = ("auv_fmu", "fmus", "pythonfmu")


def build(folder: Path, loader: str | None = None) -> list[Path]:
    """Bring a folder with FMUs and SSP up to date.

    Args:
        folder: made if it does not exist.
        loader: `native` or `plain`; None: what is there, and for new files native where it can be
            compiled.

    Returns:
        The files that had to be written.

    Raises:
        InputError: the folder cannot be written, or the FMUs cannot be built.

    """
    written = run_fmus("packaging.build", folder, *(("--loader", loader) if loader else ()))
    archive = folder / ARCHIVE
    try:
        written += _write_if_changed(archive, ssp_bytes(closed_loop(folder)))
        files = [*sorted(folder.glob("*.fmu")), archive]
        written += _write_if_changed(folder / CHECKSUMS, checksums(files))
        written += _write_if_changed(folder / BILL, bill(files))
    except OSError as error:
        raise InputError(f"cannot write the bundle into {folder}: {error}") from error
    return written


def _write_if_changed(path: Path, content: bytes) -> list[Path]:
    if path.is_file() and path.read_bytes() == content:
        return []
    with whole(path) as partial:
        partial.write_bytes(content)
    return [path]


def loader_of(folder: Path) -> str:
    """Which loader the FMUs in a folder were built with."""
    content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return str(content["loader"])


def run_fmus(module: str, folder: Path, *options: str) -> list[Path]:
    """Run a module of the package fmus that writes into a folder.

    In a process of its own: what PythonFMU imports to build must not stay in this one. Without -P
    it would import from a folder fmus in the current one.

    Returns:
        The files written.

    Raises:
        InputError: it failed.

    """
    process = subprocess.run(
        [sys.executable, "-P", "-m", f"fmus.{module}", "--out", str(folder), *options],
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode != 0:
        raise InputError(last_line(process.stderr))
    return [Path(line) for line in process.stdout.splitlines()]


@cache
def current_fmus() -> Path:
    """The folder with the FMUs of the installed sources, built if it is not there.

    Raises:
        InputError: they cannot be built, or the cache folder cannot be written.

    """
    cache_folder = user_cache_path("auv-fmu", appauthor=False) / "fmus"
    folder = cache_folder / _fingerprint()
    if _is_whole(folder):
        return folder
    try:
        cache_folder.mkdir(parents=True, exist_ok=True)
        partial = Path(mkdtemp(prefix=".partial-", dir=cache_folder))
    except OSError as error:
        raise InputError(
            f"cannot keep FMUs in {cache_folder}: {reason(error)}; set XDG_CACHE_HOME to a folder "
            "that can be written"
        ) from error
    try:
        run_fmus("packaging.build", partial)
        # What somebody has cleaned away in part is made anew.
        rmtree(folder, ignore_errors=True)
        partial.rename(folder)
    except OSError:
        # Another process was first; its folder holds the same.
        if not _is_whole(folder):
            raise
    finally:
        rmtree(partial, ignore_errors=True)
    return folder


def _is_whole(folder: Path) -> bool:
    """Whether a folder holds the FMUs that were built into it, as they were then."""
    try:
        built = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["sha256"]
        return all(digest_of(folder / name) == digest for name, digest in built.items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def _fingerprint() -> str:
    """Hash of everything that the FMUs depend on."""
    digest = hashlib.sha256()
    for package in _SOURCES:
        specification = find_spec(package)
        assert specification is not None and specification.submodule_search_locations
        [root] = specification.submodule_search_locations
        for path in sorted(Path(root).rglob("*")):
            name = path.relative_to(root)
            if path.is_file() and path.suffix != ".pyc" and name.parts[0] != "dist":
                digest.update(f"{package}/{name}\0".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
