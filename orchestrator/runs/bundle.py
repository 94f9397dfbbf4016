"""The FMUs of the installed sources, built when they are needed, and their bill of materials.

`auv-fmu build` writes it where the user wants it. Runs use FMUs of their own in the user's cache
folder, one folder for each version of the sources and each kind of FMU, so that nothing appears
where they are called.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fmus.discovery import fingerprint
from fmus.kinds import CONTAINED, FMI_VERSIONS, KINDS, NATIVE, PYTHON
from orchestrator.formats.ssp.writer import ssp_bytes
from orchestrator.machine.cache import folder_of, keep, kept, users_folder
from orchestrator.machine.children import run_module
from orchestrator.machine.disk import claimed, process_folder
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.machine.ledger import digest_of
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


#: Where `auv-fmu build` writes each kind unless another folder is named.
DEFAULT_FOLDERS = {PYTHON: Path("fmus", "dist"), NATIVE: Path("fmus", "dist", "native")}

#: The archive of the closed loop, and what was built beside it, from what.
ARCHIVE, MANIFEST = "auv.ssp", "build.json"

#: What the FMUs of runs are in the user's cache folder.
_CATEGORY = "fmus"


def build(
    folder: Path,
    loader: str | None = None,
    *,
    kind: str = PYTHON,
    fmi: str = FMI_VERSIONS[0],
    platforms: str | None = None,
    force: bool = False,
) -> list[Path]:
    """Bring a folder with FMUs and SSP up to date.

    Args:
        folder: made if it does not exist.
        loader: of the Python kind, `native` or `plain`; None: what is there, and for new files
            native where it can be compiled.
        kind: one of :data:`fmus.kinds.KINDS`.
        fmi: version, one of :data:`fmus.kinds.FMI_VERSIONS`.
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
        run_fmus("build", unfinished, *options)
        archive = unfinished / ARCHIVE
        archive.write_bytes(ssp_bytes(closed_loop(unfinished, versions=WRITABLE)))
        files = [*sorted(unfinished.glob("*.fmu")), archive]
        (unfinished / CHECKSUMS).write_bytes(checksums(files))
        (unfinished / BILL).write_bytes(bill(files, CONTAINED[kind]))
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
def current_fmus(kind: str = PYTHON, fmi: str = FMI_VERSIONS[0]) -> Path:
    """The folder with the FMUs of the installed sources, built if it is not there.

    Args:
        kind: one of :data:`fmus.kinds.KINDS`.
        fmi: version, one of :data:`fmus.kinds.FMI_VERSIONS`.

    Raises:
        InputError: there is no such kind, they cannot be built, or the cache folder cannot be
            written.

    """
    if kind not in KINDS:
        raise InputError(f"kind {kind!r}: use one of {', '.join(KINDS)}")
    key = sha256(f"{kind} {fmi} {fingerprint(kind)}".encode()).hexdigest()[:16]
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
        run_fmus("build", Path(temporary), *options)
        files = {path.name: path.read_bytes() for path in sorted(Path(temporary).iterdir())}
    return keep(_CATEGORY, key, files)[0].parent
