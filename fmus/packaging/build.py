"""Build the FMU of every component folder: `python -m fmus.packaging.build --out DIR`.

Runs in a process of its own, because PythonFMU imports what it builds. Writes a file only if
the sources have changed since it was written.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import sys
import tempfile
import zipfile
from importlib.metadata import version
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

import pythonfmu

from fmus.packaging import documentation
from fmus.packaging.discovery import components, package_folder
from fmus.packaging.loader import compiler, with_loader
from fmus.packaging.sealing import seal

_FOLDERS = {package: package_folder(package) for package in ("auv_fmu", "fmus")}
_PYTHONFMU = package_folder("pythonfmu")
_ICON = Path(__file__).with_name("icon.png")

_SCRIPT = """\
from fmus.slave.loading import settle
from {module} import {component}

settle({component}, globals(), locals())
"""

#: What a folder of built FMUs was built from, and what was built.
MANIFEST = "build.json"

#: How FMUs are loaded: by a library of our own, or by PythonFMU's.
LOADERS = ("native", "plain")


def fingerprint() -> str:
    """Hash of everything that a built FMU depends on."""
    digest = hashlib.sha256()
    for root in (*_FOLDERS.values(), _PYTHONFMU):
        for path in sorted(root.rglob("*")):
            if path.suffix in (".py", ".md", ".html", ".png", ".c", ".h", ".so", ".dll"):
                digest.update(f"{path.relative_to(root)}\0".encode())
                digest.update(path.read_bytes())
    for text in (documentation.licences(), version("markdown-it-py")):
        digest.update(text.encode())
    return digest.hexdigest()


def _stage(component: str, module: str, stage: Path, script: str, own: Path | None) -> Path:
    """Lay out a script and the modules it needs the way PythonFMU wants them."""
    path = stage / f"{script}.py"
    path.write_text(_SCRIPT.format(module=module, component=component), encoding="utf-8")
    roots = [folder.parent for folder in _FOLDERS.values()]
    finder = ModuleFinder(path=[str(root) for root in (*roots, *([own] if own else []))])
    finder.run_script(str(path))
    for name, found in finder.modules.items():
        source, top = getattr(found, "__file__", None), name.split(".")[0]
        if top in _FOLDERS and source is not None:
            root = _FOLDERS[top].parent
        elif own is not None and source is not None and _lies_in(own, Path(source), top):
            root = own
        else:
            continue
        target = stage / Path(source).relative_to(root)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    return path


def _lies_in(folder: Path, source: Path, top: str) -> bool:
    """Whether a module's top-level package stands in a folder, and not in one further below."""
    return folder in source.parents and source.relative_to(folder).parts[0] in (top, f"{top}.py")


def fmu_entries(
    component: str, module: str, loader: str, script: str, own: Path | None = None
) -> dict[str, bytes]:
    """The contents of an FMU, before it is sealed.

    Args:
        component: class of its slave.
        module: that the class is imported from.
        loader: `native` or `plain`.
        script: name of the FMU's own script.
        own: folder of modules that go into the FMU beside those of this package; None: none.

    Raises:
        OSError: the loader cannot be compiled.

    """
    with tempfile.TemporaryDirectory(prefix="auv_fmu_build_") as temporary:
        stage, built = Path(temporary, "stage"), Path(temporary, "built")
        stage.mkdir()
        path = _stage(component, module, stage, script, own)
        raw = pythonfmu.FmuBuilder.build_FMU(
            path, dest=built, project_files=set(stage.iterdir()) - {path}
        )
        with zipfile.ZipFile(raw) as archive:
            entries = {name: archive.read(name) for name in archive.namelist()}
    entries["model.png"] = _ICON.read_bytes()
    entries["documentation/licenses/license.txt"] = documentation.licences().encode()
    return with_loader(entries) if loader == "native" else entries


def _build(component: str, module: str, loader: str, destination: Path) -> None:
    entries = fmu_entries(component, module, loader, script=component)
    entries["documentation/index.html"] = documentation.html(component).encode()
    seal(entries, destination / f"{component}.fmu")


def build(destination: Path, loader: str | None = None) -> list[Path]:
    """Bring a folder of FMUs up to date.

    Args:
        destination: folder, made if it does not exist.
        loader: `native` or `plain`; None: what is there, and for new files native where it can be
            compiled.

    Returns:
        The files that had to be written.

    Raises:
        OSError: the folder cannot be written, or the loader cannot be compiled.

    """
    destination.mkdir(parents=True, exist_ok=True)
    manifest = destination / MANIFEST
    before = _built_before(manifest)
    sources = fingerprint()
    current = before.get("fingerprint") == sources and loader in (None, before.get("loader"))
    chosen = loader or (before["loader"] if current else best_loader())
    digests = before["sha256"] if current else {}
    written = []
    for component, module in components().items():
        path = destination / f"{component}.fmu"
        if not path.is_file() or digests.get(path.name) != _digest(path):
            _build(component, module, chosen, destination)
            digests[path.name] = _digest(path)
            written.append(path)
    if written:
        content = {"fingerprint": sources, "loader": chosen, "sha256": digests}
        manifest.write_text(json.dumps(content) + "\n", encoding="utf-8")
    return written


def _built_before(manifest: Path) -> dict[str, Any]:
    """What a manifest says; empty if there is none, or it is none of ours."""
    try:
        content = json.loads(manifest.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    ours = isinstance(content, dict) and isinstance(content.get("sha256"), dict)
    return content if ours and content.get("loader") in LOADERS else {}


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def best_loader() -> str:
    """The loader for new files: native where it can be compiled."""
    return "plain" if compiler() is None else "native"


def main() -> int:
    """Command line of the module."""
    parser = argparse.ArgumentParser(prog="python -m fmus.packaging.build", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("fmus", "dist"), help="folder to write")
    parser.add_argument("--loader", choices=LOADERS, help="default: native if it can")
    options = parser.parse_args()
    try:
        for path in build(options.out, options.loader):
            print(path)
    except OSError as error:
        print(f"cannot build the FMUs: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
