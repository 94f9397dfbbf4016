"""What FMUs are made from: component folders and all that they need. What they become: archives."""

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
from importlib.util import find_spec
from inspect import cleandoc
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from fmus.kinds import CONTAINED
from fmus.ports.definition import Definition, define

#: The marks in a `page.md` between which `tools/pages.py` writes the tables of ports.
FILLED = ("<!-- filled: ports -->", "<!-- / -->")

_PORTS = re.compile(rf"{FILLED[0]}.*?{FILLED[1]}\n*", re.DOTALL)

#: The folder of a component that holds its reference results.
REFERENCE = "reference"

#: Where FMI-LS-REF has them in an FMU, and the file there that names them.
RELATED = "extra/org.fmi-standard.fmi-ls-ref"
RELATED_MANIFEST = "fmi-ls-manifest.xml"

#: The oldest time a zip archive can hold: the time of a build is not part of its result.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def package_folder(package: str) -> Path:
    """Where an installed package is; only the packages that it lies in are imported."""
    specification = find_spec(package)
    assert specification is not None and specification.submodule_search_locations
    [folder] = specification.submodule_search_locations
    return Path(folder)


def lies_in(folder: Path, file: Path, module: str) -> bool:
    """Whether a module's top-level package stands in a folder, and not in one further below."""
    top = module.partition(".")[0]
    return folder in file.parents and file.relative_to(folder).parts[0] in (top, f"{top}.py")


def name_of(module: str) -> str:
    """The name of a component, from that of its module or folder: `water_tank`, `WaterTank`."""
    return "".join(word[:1].upper() + word[1:] for word in module.split("_"))


def components() -> dict[str, str]:
    """The name of every component, and its module."""
    return {
        name_of(file.parent.name): f"fmus.{file.parent.name}.component"
        for file in sorted(package_folder("fmus").glob("*/page.md"))
    }


class Source(NamedTuple):
    """What the FMU of a component is made from.

    Attributes:
        name: of the component.
        module: that says it all.
        folder: that its page and its reference results lie in.
        root: that it is imported from; None: it is installed.

    """

    name: str
    module: str
    folder: Path
    root: Path | None = None

    @property
    def definition(self) -> Definition:
        """What its module says; it is imported.

        Raises:
            Misdeclared: it is no component.

        """
        return define(self.name, import_module(self.module))

    @property
    def page(self) -> str:
        """Description in Markdown, without ports, from `page.md` or the docstring of the module."""
        page = self.folder / "page.md"
        if self.root is None and page.is_file():
            return _PORTS.sub("", page.read_text(encoding="utf-8")).strip()
        said = cleandoc(import_module(self.module).__doc__ or "")
        return f"# {self.name}\n\n{said}".strip()


def source_of(name: str) -> Source:
    """What a component of the bundle is made from."""
    module = components()[name]
    return Source(name, module, package_folder(module.rpartition(".")[0]))


def related_files(source: Source) -> dict[str, bytes]:
    """The reference results that an FMU of a component carries, by their places in it.

    Returns:
        The manifest and the files that it names; empty if the component has none.

    """
    folder = source.folder / REFERENCE
    manifest = folder / RELATED_MANIFEST
    if not manifest.is_file():
        return {}
    related = ElementTree.parse(manifest).iter("Related")
    names = (manifest.name, *(element.attrib["source"] for element in related))
    return {f"{RELATED}/{name}": (folder / name).read_bytes() for name in names}


def licences(kind: str) -> str:
    """Licence of the bundle, and of what else FMUs of a kind contain."""
    heads = {"auv-fmu": "auv-fmu", "pythonfmu": "PythonFMU, contained in resources and binaries"}
    return "\n\n".join(
        f"{heads[package]}\n\n{distribution(package).read_text('licenses/LICENSE') or ''}"
        for package in ("auv-fmu", *CONTAINED[kind])
    )


def fingerprint(kind: str) -> str:
    """Hash of everything installed that FMUs of a kind are made of, the same on all machines.

    Not of the tools: a C compiler, and what makes a page of Markdown.
    """
    digest = hashlib.sha256()
    for package in ("auv_fmu", "fmus", *CONTAINED[kind]):
        root = package_folder(package)
        files = {path.relative_to(root).as_posix(): path for path in root.rglob("*")}
        for name, path in sorted(files.items()):
            # The first is Python's own, the second what was built of them.
            if path.is_file() and path.suffix != ".pyc" and not name.startswith("dist/"):
                digest.update(f"{package}/{name}\0".encode())
                digest.update(path.read_bytes())
    digest.update(licences(kind).encode())
    return digest.hexdigest()


class Origin(NamedTuple):
    """What the FMU of a user's script was made from, as it is recorded in the FMU.

    Attributes:
        fmu: name of the file of the FMU.
        kind: of the FMU.
        folder: of the script, from that of the FMU on.
        script: its name.
        digests: of the files, by their paths from the folder of the script on.

    """

    fmu: str
    kind: str
    folder: str
    script: str
    digests: Mapping[str, str]

    def changed(self, fmu: Path) -> list[Path]:
        """The files that are others now than when an FMU was built; none, if there is no script."""
        folder = self.place(fmu)
        if not (folder / self.script).is_file():
            return []
        paths = {folder / name: digest for name, digest in self.digests.items()}
        return [path for path, digest in paths.items() if digest_at(path) != digest]

    def place(self, fmu: Path) -> Path:
        """The folder of the script of an FMU."""
        return Path(os.path.normpath(fmu.parent / self.folder))


#: Where an FMU has it.
ORIGIN = "extra/auv-fmu/origin.json"


def origin_of(content: bytes) -> Origin | None:
    """What a record of an origin says; None: it is none of ours."""
    try:
        origin = Origin(**json.loads(content))
        names = [origin.fmu, origin.script, *origin.digests]
        is_below = not any(Path(name).is_absolute() or ".." in Path(name).parts for name in names)
        is_ours = is_below and not Path(origin.folder).is_absolute()
    except (AttributeError, RecursionError, TypeError, ValueError):
        return None
    return origin if is_ours else None


def digest_at(path: Path) -> str | None:
    """The SHA-256 of a file, whatever ends its lines; None: there is no such file."""
    try:
        content = path.read_bytes() if path.is_file() else None
    except OSError:
        return None
    if content is None:
        return None
    return hashlib.sha256(content.replace(b"\r\n", b"\n")).hexdigest()


def add_to_archive(path: Path, name: str, content: bytes) -> None:
    """Add an entry to an archive, whose bytes still depend only on its entries."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(_info(name), content, compresslevel=9)


def write_archive(path: Path, entries: dict[str, bytes]) -> None:
    """Write a zip archive whose bytes depend only on its entries, all at once."""
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
    """What tells contents from all others."""
    digest = hashlib.sha256()
    for name in sorted(contents):
        digest.update(f"{name}\0{len(contents[name])}\0".encode())
        digest.update(contents[name])
    return digest.digest()


def guid_of(digest: bytes) -> str:
    """A GUID made from a digest."""
    return f"{{{uuid.UUID(bytes=digest[:16])}}}"
