"""The bundled components, the sources of FMUs, and their archives."""

from __future__ import annotations

import hashlib
import json
import os
import re
import uuid
import zipfile
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import distribution
from inspect import cleandoc
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from fmus.kinds import CONTAINED
from fmus.ports.definition import Definition, define
from orchestrator.machine.identity import package_folder

#: The marks in a `page.md` between which `tools/pages.py` writes the tables of ports.
FILLED = ("<!-- filled: ports -->", "<!-- / -->")

_PORTS = re.compile(rf"{FILLED[0]}.*?{FILLED[1]}\n*", re.DOTALL)

#: The folder of a component that holds its reference results.
REFERENCE = "reference"

#: Their folder in an FMU according to FMI-LS-REF, and the file that lists them.
RELATED = "extra/org.fmi-standard.fmi-ls-ref"
RELATED_MANIFEST = "fmi-ls-manifest.xml"

#: The oldest time in a zip archive, used for all entries so that builds are reproducible.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def lies_in(folder: Path, file: Path, module: str) -> bool:
    """Return True if a module's top-level package is directly in a folder."""
    top = module.partition(".")[0]
    return folder in file.parents and file.relative_to(folder).parts[0] in (top, f"{top}.py")


def name_of(module: str) -> str:
    """Make the name of a component from its module or folder: `WaterTank` from `water_tank`."""
    return "".join(word[:1].upper() + word[1:] for word in module.split("_"))


def components() -> dict[str, str]:
    """Return the modules of all bundled components, by the names of the components."""
    return {
        name_of(file.parent.name): f"fmus.{file.parent.name}.component"
        for file in sorted(package_folder("fmus").glob("*/page.md"))
    }


class Source(NamedTuple):
    """Source of a component's FMU.

    Attributes:
        name: name of the component.
        module: name of its module.
        folder: folder of its page and its reference results.
        root: folder that it is imported from; None if it is installed.

    """

    name: str
    module: str
    folder: Path
    root: Path | None = None

    @property
    def definition(self) -> Definition:
        """Definition of the component, whose module is imported.

        Raises:
            Misdeclared: it is not a component.

        """
        return define(self.name, import_module(self.module))

    @property
    def page(self) -> str:
        """Author's description in Markdown without ports, from `page.md` or the docstring."""
        page = self.folder / "page.md"
        if self.root is None and page.is_file():
            return _PORTS.sub("", page.read_text(encoding="utf-8")).strip()
        text = cleandoc(import_module(self.module).__doc__ or "")
        return f"# {self.name}\n\n{text}".strip()


def source_of(name: str) -> Source:
    """Return the source of a bundled component."""
    module = components()[name]
    return Source(name, module, package_folder(module.rpartition(".")[0]))


def related_files(source: Source) -> dict[str, bytes]:
    """Read the reference results of a component, by their paths in its FMU.

    Returns:
        The manifest and the files that it lists; empty if the component has none.

    """
    folder = source.folder / REFERENCE
    manifest = folder / RELATED_MANIFEST
    if not manifest.is_file():
        return {}
    related = ElementTree.parse(manifest).iter("Related")
    names = (manifest.name, *(element.attrib["source"] for element in related))
    return {f"{RELATED}/{name}": (folder / name).read_bytes() for name in names}


def licences(kind: str) -> str:
    """Return the licences of the bundle and of the packages in FMUs of a kind."""
    heads = {"auv-fmu": "auv-fmu", "pythonfmu": "PythonFMU, contained in resources and binaries"}
    return "\n\n".join(
        f"{heads[package]}\n\n{distribution(package).read_text('licenses/LICENSE') or ''}"
        for package in ("auv-fmu", *CONTAINED[kind])
    )


def fingerprint(kind: str) -> str:
    """Return a hash of all installed sources of FMUs of a kind, the same on all machines.

    It does not include the tools, such as C compilers and Markdown renderers.
    """
    digest = hashlib.sha256()
    for package in ("auv_fmu", "fmus", *CONTAINED[kind]):
        root = package_folder(package)
        files = {path.relative_to(root).as_posix(): path for path in root.rglob("*")}
        for name, path in sorted(files.items()):
            # Skip byte code, and built FMUs.
            if path.is_file() and path.suffix != ".pyc" and not name.startswith("dist/"):
                digest.update(f"{package}/{name}\0".encode())
                digest.update(path.read_bytes())
    digest.update(licences(kind).encode())
    return digest.hexdigest()


class Origin(NamedTuple):
    """Record in an FMU of the user's script that it was made from.

    Attributes:
        fmu: file name of the FMU.
        kind: kind of the FMU.
        folder: folder of the script, relative to the folder of the FMU.
        script: file name of the script.
        digests: digests of the files, by their paths relative to the folder of the script.

    """

    fmu: str
    kind: str
    folder: str
    script: str
    digests: Mapping[str, str]

    def changed(self, fmu: Path) -> list[Path]:
        """Return the files that changed since an FMU was built; none if there is no script."""
        folder = self.place(fmu)
        if not (folder / self.script).is_file():
            return []
        paths = {folder / name: digest for name, digest in self.digests.items()}
        return [path for path, digest in paths.items() if digest_at(path) != digest]

    def place(self, fmu: Path) -> Path:
        """Return the folder of the script of an FMU."""
        return Path(os.path.normpath(fmu.parent / self.folder))


#: Its path in an FMU.
ORIGIN = "extra/auv-fmu/origin.json"


def origin_of(content: bytes) -> Origin | None:
    """Read the record of an origin; None if another program wrote it."""
    try:
        origin = Origin(**json.loads(content))
        names = [origin.fmu, origin.script, *origin.digests]
        is_below = not any(Path(name).is_absolute() or ".." in Path(name).parts for name in names)
        is_ours = is_below and not Path(origin.folder).is_absolute()
    except (AttributeError, RecursionError, TypeError, ValueError):
        return None
    return origin if is_ours else None


def digest_at(path: Path) -> str | None:
    """Return the SHA-256 of a file, with any line endings; None if there is no such file."""
    try:
        content = path.read_bytes() if path.is_file() else None
    except OSError:
        return None
    if content is None:
        return None
    return hashlib.sha256(content.replace(b"\r\n", b"\n")).hexdigest()


def add_to_archive(path: Path, name: str, content: bytes) -> None:
    """Add an entry to an archive; its bytes still depend only on its entries."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(_info(name), content, compresslevel=9)


def write_archive(path: Path, entries: dict[str, bytes]) -> None:
    """Write a zip archive atomically; its bytes depend only on its entries."""
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        with zipfile.ZipFile(partial, "w") as archive:
            for name in sorted(entries):
                archive.writestr(_info(name), entries[name], compresslevel=9)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _info(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, _EPOCH)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.create_system = 3
    info.external_attr = 0o644 << 16
    return info


def digest_of(contents: Mapping[str, bytes]) -> bytes:
    """Return a digest of files by name."""
    digest = hashlib.sha256()
    for name in sorted(contents):
        digest.update(f"{name}\0{len(contents[name])}\0".encode())
        digest.update(contents[name])
    return digest.digest()


def guid_of(digest: bytes) -> str:
    """Make a GUID from a digest."""
    return f"{{{uuid.UUID(bytes=digest[:16])}}}"
