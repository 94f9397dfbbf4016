"""Building the bundle, and the FMUs of runs.

`auv-fmu build` writes the bundle into the user's folder. Runs keep their FMUs in the user's cache
folder, one folder for each version of the sources and each kind of FMU, so that no files appear in
the current folder.

"""

from __future__ import annotations

import json
import logging
import shutil
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import TypedDict, Unpack

from fmus.discovery import components, fingerprint
from fmus.kinds import AUTO, FMI_VERSIONS, KINDS, NATIVE, PYTHON
from orchestrator.cosim import write_ssp
from orchestrator.machine.cache import made_once, read_cached, users_folder
from orchestrator.machine.children import run_module
from orchestrator.machine.compilers import compiler_for, platforms
from orchestrator.machine.disk import sha256_of, temporary_folder
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.machine.lazy import progress_bar
from orchestrator.runs.folder import replace_files
from orchestrator.runs.wiring import closed_loop

#: Takes lines on what takes long and happens only once; the command line shows them.
LOG = logging.getLogger("auv_fmu")

#: Default folders of `auv-fmu build`.
DEFAULT_FOLDERS = {PYTHON: Path("fmus", "dist"), NATIVE: Path("fmus", "dist", "native")}

#: Further files of a bundle: archive of the closed loop, settings of the build, checksums.
ARCHIVE, MANIFEST, CHECKSUMS = "auv.ssp", "build.json", "SHA256SUMS"

#: The folder of the FMUs of runs, in the user's cache folder.
CATEGORY = "fmus"


class BuildFailed(InputError):
    """The FMU of a user's script cannot be built."""


class Form(TypedDict, total=False):
    """Form of FMUs.

    Attributes:
        kind: one of :data:`fmus.kinds.KINDS`; default: python.
        fmi: version, one of :data:`fmus.kinds.FMI_VERSIONS`.
        loader: of the Python kind, `native` or `plain`; None: as in existing files; for new files
            native, if it can be compiled.
        platforms: of the native kind, with commas between them; None: this machine.
        arrays: True if vectors and matrices of one unit are arrays of FMI 3.0.

    """

    kind: str
    fmi: str
    loader: str | None
    platforms: str | None
    arrays: bool


def words_of(form: Form) -> list[str]:
    """Return the options of the build for a form."""
    words = [
        word
        for name, value in form.items()
        if isinstance(value, str)
        for word in (f"--{name}", value)
    ]
    return words + ["--arrays"] * form.get("arrays", False)


def build_bundle(
    folder: Path,
    *,
    force: bool = False,
    hear: Callable[[str], None] = lambda line: None,
    **form: Unpack[Form],
) -> list[Path]:
    """Bring a folder with FMUs and SSP up to date.

    Args:
        folder: made if it does not exist.
        force: move aside files of the user's that are in the way.
        hear: called with a line when an FMU, or a library in it, is made.
        form: of the FMUs; with arrays, no SSP is written, because its connections are of scalars.

    Returns:
        The files that had to be written.

    Raises:
        InputError: the folder cannot be written, or the FMUs cannot be built.

    """
    with replace_files(folder, (ARCHIVE, MANIFEST, CHECKSUMS), force=force) as staging:
        # FMUs that are up to date are kept.
        for path in (*folder.glob("*.fmu"), folder / MANIFEST):
            if path.is_file():
                shutil.copy2(path, staging)
        run_fmus("build", staging, *words_of(form), hear=hear)
        files = sorted(staging.glob("*.fmu"))
        if not form.get("arrays"):
            files += write_ssp(closed_loop(staging), staging)
        write_checksums(staging, files)
        for path in staging.iterdir():
            before = folder / path.name
            if before.is_file() and before.read_bytes() == path.read_bytes():
                path.unlink()
        written = sorted(path.name for path in staging.iterdir())
    return [folder / name for name in written]


def write_checksums(folder: Path, files: Sequence[Path]) -> Path:
    """Write the checksums of files in a folder for `sha256sum --check`."""
    lines = (f"{sha256_of(path)}  {path.relative_to(folder).as_posix()}\n" for path in files)
    (folder / CHECKSUMS).write_bytes("".join(lines).encode())
    return folder / CHECKSUMS


def settings_of(folder: Path) -> dict[str, str]:
    """Read the settings of a build, such as the kind of the FMUs, from its folder."""
    content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    return dict(content["settings"])


def run_fmus(
    module: str, folder: Path, *options: str, hear: Callable[[str], None] = lambda line: None
) -> list[str]:
    """Run a module of the package fmus, such as `build`, that writes into a folder.

    It runs in a separate process, because PythonFMU imports modules of the user to build. `hear` is
    called with each line of its output as it comes; the lines are returned.

    Raises:
        BuildFailed: it failed because of a user's script.
        InputError: it failed for another reason.

    """
    try:
        process = run_module(f"fmus.{module}", "--out", str(folder), *options, hear=hear)
    except OSError as error:
        raise InputError(f"the FMUs cannot be built: {reason(error)}") from error
    if process.returncode != 0:
        failure = BuildFailed if process.returncode == 1 else InputError
        raise failure(last_line(process.stderr))
    return process.stdout.splitlines()


@cache
def current_fmus(
    kind: str = AUTO, fmi: str = FMI_VERSIONS[0], platforms: str | None = None
) -> Path:
    """Return the folder with the FMUs of the installed sources; they are built if they are missing.

    Args:
        kind: one of :data:`fmus.kinds.KINDS`, or `auto`: native if they exist or can be built, else
            Python.
        fmi: version, one of :data:`fmus.kinds.FMI_VERSIONS`.
        platforms: of the native kind, with commas between them; None: this machine.

    Raises:
        InputError: there is no such kind, they cannot be built, or the cache folder cannot be
            written.

    """
    if kind == AUTO:
        return _best_fmus(fmi)
    if kind not in KINDS:
        raise InputError(f"kind {kind!r}: use one of {', '.join((AUTO, *KINDS))}")
    words = words_of(Form(kind=kind, fmi=fmi, platforms=platforms))
    files = kept_fmus(key_of(kind, fmi, platforms), partial(_built, *words))
    return next(iter(files.values())).parent


def kept_fmus(key: str, build: Callable[[], Mapping[str, bytes]]) -> dict[str, Path]:
    """Return the FMUs in the user's cache folder with a key, by name; `build` makes missing ones.

    Raises:
        InputError: they cannot be built, or the cache folder cannot be written.

    """
    try:
        return made_once(CATEGORY, key, build)
    except OSError as error:
        raise InputError(
            f"cannot keep FMUs in {users_folder()}: {reason(error)}; set XDG_CACHE_HOME to a "
            "writable folder"
        ) from error


def _best_fmus(fmi: str) -> Path:
    if fmi != FMI_VERSIONS[0]:
        # The Python kind has only the first.
        return current_fmus(NATIVE, fmi)
    for path in read_cached(CATEGORY, key_of(NATIVE, fmi)):
        # They were built earlier.
        return path.parent
    if best_kind(fmi) == PYTHON:
        return current_fmus(PYTHON, fmi)
    try:
        return current_fmus(NATIVE, fmi)
    except InputError as error:
        # The compiler may lack files that it needs.
        folder = current_fmus(PYTHON, fmi)
        warnings.warn(f"the Python kind of FMU is used, because {error}", stacklevel=3)
        return folder


def best_kind(fmi: str = FMI_VERSIONS[0]) -> str:
    """Return the kind of FMU to build here: native with a C compiler, else Python."""
    try:
        compiler_for(platforms(fmi))
    except (OSError, ValueError):
        return PYTHON
    return NATIVE


def key_of(kind: str, fmi: str, platforms: str | None = None) -> str:
    """Cache key of the FMUs of the installed sources."""
    form = f"{kind} {fmi} {fingerprint(kind)}" + (f" {platforms}" if platforms else "")
    return sha256(form.encode()).hexdigest()[:16]


def _built(*options: str) -> dict[str, bytes]:
    """Build FMUs, and return the content of the files by name."""
    heard: list[str] = []
    with (
        temporary_folder() as folder,
        progress_bar(total=len(components()), unit="FMU", disable=None, leave=False) as bar,
    ):

        def hear(line: str) -> None:
            """Say that FMUs will be made, then count them."""
            if heard:
                bar.update()
            else:
                LOG.info("%s (only once) ...", line)
            heard.append(line)

        run_fmus("build", folder, *options, hear=hear)
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
