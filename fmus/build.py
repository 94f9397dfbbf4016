"""Build the FMUs of all components, or of a user's one: `python -m fmus.build [SCRIPT] --out DIR`.

It runs in a separate process, because PythonFMU imports the components that it builds. An FMU of
the bundle is written only if its sources have changed; a user's FMU is always written.
"""

from __future__ import annotations

import argparse
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from fmus.discovery import (
    ORIGIN,
    Origin,
    add_to_archive,
    components,
    digest_at,
    fingerprint,
    source_of,
)
from fmus.kinds import FMI_VERSIONS, KINDS, PYTHON
from fmus.native.packaging import NativeKind
from fmus.python.modules import modules_of
from fmus.python.packaging import LOADERS, PythonKind, best_loader, build_script
from fmus.script import (
    data_files,
    is_component,
    message_of,
    no_component,
    script_in,
    source_of_script,
)
from orchestrator.machine.compilers import compiler_for, platforms
from orchestrator.machine.disk import sha256_of

#: Exit status if the user's script cannot be built; other errors give 2.
FAILED = 1

#: The file in a folder of FMUs that records their sources and digests.
MANIFEST = "build.json"


def build(destination: Path, kind: PythonKind | NativeKind) -> None:
    """Bring a folder of FMUs up to date.

    Raises:
        OSError: the folder cannot be written, or the FMUs cannot be built.

    """
    destination.mkdir(parents=True, exist_ok=True)
    manifest = destination / MANIFEST
    made_from = {"fingerprint": fingerprint(kind.name), "settings": kind.settings}
    before = built_before(manifest)
    current = {key: before.get(key) for key in made_from} == made_from
    digests = before["sha256"] if current else {}
    stale = {
        path: source_of(component)
        for component in components()
        if not (path := destination / f"{component}.fmu").is_file()
        or digests.get(path.name) != sha256_of(path)
    }

    def write(path: Path) -> None:
        kind.write(stale[path], path)
        if isinstance(kind, PythonKind):
            # The other kind reports its libraries.
            _report(path.stem)

    if stale:
        _report(f"building {len(stale)} FMU{'s' * (len(stale) > 1)}")
    with ThreadPoolExecutor(kind.side_by_side) as pool:
        list(pool.map(write, stale))
    if stale:
        digests |= {path.name: sha256_of(path) for path in stale}
        text = json.dumps({**made_from, "sha256": digests})
        manifest.write_text(text + "\n", encoding="utf-8")


def built_before(manifest: Path) -> dict[str, Any]:
    """Read a manifest; empty if there is none, or another program wrote it."""
    try:
        content = json.loads(manifest.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    parts = ("settings", "sha256")
    ours = isinstance(content, dict) and all(isinstance(content.get(p), dict) for p in parts)
    return content if ours else {}


def _report(line: str) -> None:
    """Print a line at once and in one piece, since several threads print."""
    print(f"{line}\n", end="", flush=True)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m fmus.build", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("fmus", "dist"), help="folder to write")
    parser.add_argument("--kind", choices=KINDS, default=KINDS[0])
    parser.add_argument("--loader", choices=LOADERS, help="default: native if it can")
    parser.add_argument("--fmi", choices=FMI_VERSIONS, default=FMI_VERSIONS[0])
    parser.add_argument("--arrays", action="store_true", help="of FMI 3.0, for vectors")
    parser.add_argument("--platforms", metavar="NAME,...|all", help="default: this machine")
    parser.add_argument(
        "--from", dest="home", default=".", help="the script's folder from the FMU's"
    )
    parser.add_argument("script", nargs="?", type=Path, help="a component; default: all")
    options = parser.parse_args()
    try:
        kind = _kind(options)
        if options.script is not None:
            return _build_own(options.script, options.out, kind, options.home)
        build(options.out, kind)
    except (OSError, ValueError) as error:
        print(f"cannot build the FMUs: {error}", file=sys.stderr)
        return 2
    return 0


def _build_own(path: Path, folder: Path, kind: PythonKind | NativeKind, home: str) -> int:
    """Build the FMU of a user's component, or print its first mistake; return the exit status."""
    try:
        path = script_in(path)
        if not is_component(path) and not isinstance(kind, PythonKind):
            raise ValueError(f"{no_component(path)}; a class of PythonFMU needs --kind {PYTHON}")
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    try:
        if is_component(path):
            source = source_of_script(path)
            # Read it before PythonFMU imports a copy, where mistakes would have other places.
            source.definition  # noqa: B018
            fmu = folder / f"{source.name}.fmu"
            kind.write(source, fmu)
        else:
            assert isinstance(kind, PythonKind)
            fmu = build_script(path, folder, kind.loader)
        origin = Origin(fmu.name, kind.name, home, path.name, _digests(path))
        add_to_archive(fmu, ORIGIN, json.dumps(origin._asdict()).encode())
    except Exception as error:
        print(message_of(error, path), file=sys.stderr)
        return FAILED
    return 0


def _digests(script: Path) -> dict[str, str]:
    """Return the digests of all the user's files that an FMU was made from."""
    root = script.resolve().parent
    files = modules_of(f"import {script.stem}", {}, root)
    return {
        file.relative_to(root).as_posix(): digest_at(file) or ""
        for _, file in sorted({**data_files(root), **files}.items())
        if root in file.parents
    }


def _kind(options: argparse.Namespace) -> PythonKind | NativeKind:
    """Make the kind that the options describe.

    Raises:
        ValueError: the options contradict each other.
        OSError: there is no compiler for them.

    """
    if options.kind == PYTHON:
        if options.platforms is not None or options.fmi != FMI_VERSIONS[0] or options.arrays:
            raise ValueError("--platforms, --fmi 3 and --arrays need --kind native")
        # By default the loader of the present FMUs is kept.
        before = built_before(options.out / MANIFEST)
        is_current = before.get("fingerprint") == fingerprint(PYTHON)
        kept = before["settings"].get("loader") if is_current else None
        return PythonKind(options.loader or kept or best_loader())
    if options.loader is not None:
        raise ValueError("--loader is for --kind python: the other kind loads no Python")
    wanted = platforms(options.fmi, options.platforms)
    if options.arrays and options.fmi == FMI_VERSIONS[0]:
        raise ValueError("--arrays needs --fmi 3")
    return NativeKind(options.fmi, wanted, compiler_for(wanted), _report, options.arrays)


if __name__ == "__main__":
    sys.exit(main())
