"""The FMUs of the installed sources, built when they are needed, and their bill of materials.

`auv-fmu build` writes it where the user wants it. Runs use FMUs of their own in the user's cache
folder, one folder for each version of the sources and each kind of FMU, so that nothing appears
where they are called.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from orchestrator.formats.ssp.writer import ssp_bytes
from orchestrator.machine.cache import folder_of, keep, kept, users_folder
from orchestrator.machine.children import run_module
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.machine.ledger import digest_of
from orchestrator.machine.locks import claimed, process_folder
from orchestrator.runs.folder import replaced
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.component import WRITABLE

CHECKSUMS, BILL = "SHA256SUMS", "bom.cdx.json"


def checksums(files: Sequence[Path]) -> bytes:
    """Checksums as `sha256sum --check` reads them."""
    return "".join(f"{digest_of(path)}  {path.name}\n" for path in files).encode()


def bill(files: Sequence[Path], contained: Sequence[str]) -> bytes:
    """CycloneDX 1.5: the files of the bundle and the packages whose code they contain.

    Without time and serial number: the same bundle has the same bill.

    Args:
        files: of the bundle.
        contained: the packages, besides ours.

    """
    ours, *others = map(_package, ("auv-fmu", *contained))
    content = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": ours},
        "components": [
            *others,
            *(
                {
                    "type": "file",
                    "name": path.name,
                    "hashes": [{"alg": "SHA-256", "content": digest_of(path)}],
                }
                for path in files
            ),
        ],
        "dependencies": [
            {"ref": ours["bom-ref"], "dependsOn": [package["bom-ref"] for package in others]}
        ],
    }
    return (json.dumps(content, indent=2) + "\n").encode()


def _package(name: str) -> dict[str, Any]:
    reference = f"pkg:pypi/{name}@{version(name)}"
    return {
        "type": "library",
        "bom-ref": reference,
        "name": name,
        "version": version(name),
        "licenses": [{"license": {"id": "MIT"}}],
        "purl": reference,
    }


#: The kinds of FMU that a component comes as: Python sources, or their translation to C.
KINDS = PYTHON, NATIVE = "python", "native"

#: The versions of FMI; the Python kind has the first.
FMI = ("2", "3")

#: Where `auv-fmu build` writes each kind unless another folder is named.
DEFAULT_FOLDERS = {PYTHON: Path("fmus", "dist"), NATIVE: Path("fmus", "dist", "native")}

#: The archive of the closed loop, and what was built beside it, from what.
ARCHIVE, MANIFEST = "auv.ssp", "build.json"

#: What the FMUs of runs are in the user's cache folder.
_CATEGORY = "fmus"

#: Packages that the FMUs of each kind are made of.
_SOURCES = {PYTHON: ("auv_fmu", "fmus", "pythonfmu"), NATIVE: ("auv_fmu", "fmus")}

#: Packages besides ours whose code is in them.
_CONTAINED = {PYTHON: ("pythonfmu",), NATIVE: ()}


def build(
    folder: Path,
    loader: str | None = None,
    *,
    kind: str = PYTHON,
    fmi: str = FMI[0],
    platforms: str | None = None,
    force: bool = False,
) -> list[Path]:
    """Bring a folder with FMUs and SSP up to date.

    Args:
        folder: made if it does not exist.
        loader: of the Python kind, `native` or `plain`; None: what is there, and for new files
            native where it can be compiled.
        kind: one of :data:`KINDS`.
        fmi: version, one of :data:`FMI`.
        platforms: of the native kind, with commas between them; None: this machine.
        force: move aside files of the user's that have names of these.

    Returns:
        The files that had to be written.

    Raises:
        InputError: the folder cannot be written, or the FMUs cannot be built.

    """
    with replaced(folder, (ARCHIVE, MANIFEST, CHECKSUMS, BILL), force=force) as unfinished:
        # What is up to date is taken along, and not written anew.
        for path in (*folder.glob("*.fmu"), folder / MANIFEST):
            if path.is_file():
                shutil.copy2(path, unfinished)
        options = ["--kind", kind, "--fmi", fmi]
        options += ["--loader", loader] if loader is not None else []
        options += ["--platforms", platforms] if platforms is not None else []
        run_fmus("packaging.build", unfinished, *options)
        archive = unfinished / ARCHIVE
        archive.write_bytes(ssp_bytes(closed_loop(unfinished, versions=WRITABLE)))
        files = [*sorted(unfinished.glob("*.fmu")), archive]
        (unfinished / CHECKSUMS).write_bytes(checksums(files))
        (unfinished / BILL).write_bytes(bill(files, _CONTAINED[kind]))
        for path in unfinished.iterdir():
            before = folder / path.name
            if before.is_file() and before.read_bytes() == path.read_bytes():
                path.unlink()
        written = sorted(path.name for path in unfinished.iterdir())
    return [folder / name for name in written]


def settings_of(folder: Path) -> dict[str, str]:
    """How the FMUs in a folder were built."""
    content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return dict(content["settings"])


def run_fmus(module: str, folder: Path, *options: str) -> list[Path]:
    """Run a module of the package fmus that writes into a folder.

    In a process of its own: what PythonFMU imports to build must not stay in this one.

    Returns:
        The files written.

    Raises:
        InputError: it failed.

    """
    try:
        process = run_module(f"fmus.{module}", "--out", str(folder), *options)
    except OSError as error:
        raise InputError(f"the FMUs cannot be built: {reason(error)}") from error
    if process.returncode != 0:
        raise InputError(last_line(process.stderr))
    return [Path(line) for line in process.stdout.splitlines()]


@cache
def current_fmus(kind: str = PYTHON, fmi: str = FMI[0]) -> Path:
    """The folder with the FMUs of the installed sources, built if it is not there.

    Args:
        kind: one of :data:`KINDS`.
        fmi: version, one of :data:`FMI`.

    Raises:
        InputError: there is no such kind, they cannot be built, or the cache folder cannot be
            written.

    """
    if kind not in KINDS:
        raise InputError(f"kind {kind!r}: use one of {', '.join(KINDS)}")
    key = _fingerprint(kind, fmi)
    if found := _kept(key):
        return found
    try:
        with claimed(folder_of(_CATEGORY), wait=True):
            # Another process may have been first.
            return _kept(key) or _built(key, "--kind", kind, "--fmi", fmi)
    except OSError as error:
        raise InputError(
            f"cannot keep FMUs in {users_folder()}: {reason(error)}; set XDG_CACHE_HOME to a "
            "folder that can be written"
        ) from error


def _kept(key: str) -> Path | None:
    """The folder of FMUs that were built earlier."""
    return next((path.parent for path in kept(_CATEGORY, key)), None)


def _built(key: str, *options: str) -> Path:
    """Build FMUs, and keep them."""
    with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
        run_fmus("packaging.build", Path(temporary), *options)
        files = {path.name: path.read_bytes() for path in sorted(Path(temporary).iterdir())}
    return keep(_CATEGORY, key, files)[0].parent


def _fingerprint(kind: str, fmi: str) -> str:
    """Hash of everything that the FMUs of a kind depend on."""
    digest = hashlib.sha256(f"{kind} {fmi}\0".encode())
    for package in _SOURCES[kind]:
        specification = find_spec(package)
        assert specification is not None and specification.submodule_search_locations
        [root] = specification.submodule_search_locations
        for path in sorted(Path(root).rglob("*")):
            name = path.relative_to(root)
            if path.is_file() and path.suffix != ".pyc" and name.parts[0] != "dist":
                digest.update(f"{package}/{name}\0".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
