"""Public FMUs and SSP archives, from the repositories that hold them.

This repository holds none of them: they are cloned from their public addresses at the commits
below, and every file counts once, in however many repositories it is.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from pathlib import Path, PurePosixPath
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile, ZipInfo

#: Repositories on GitHub with FMUs and archives, and their commits.
PLACES = {
    "open-simulation-platform/libcosim": "52cc82513d3099df3c1c91eeb980227db52c70cf",
    "open-simulation-platform/demo-cases": "406ccab659b582abf36a2b6a6dac270ff3ab3456",
    "open-simulation-platform/osp-validator": "31bc9d73815eaa98e6ca8519dd401b2ae1783d1c",
    "Ecos-platform/ecos": "cdfdeb2cb25db39c867f9e3c922c7ab0b26b76d4",
    "NTNU-IHB/Vico": "b3e82cf9c7101a48180e817af600ed789e4a7e8c",
    "NTNU-IHB/sspgen": "ae9286dd8c60fb03de8bab6fb25fb5dd6803d870",
    "NTNU-IHB/FMI4j": "824347062b52f1808b50fc52e5dc716755a6ff3e",
    "NTNU-IHB/FMI4cpp": "b29291588ff46a1a85cfd04bc2974078838ec8c6",
    "NTNU-IHB/FMU-proxy": "152bd5d362eac2107e466c9f2c216324f42d8487",
    "OpenModelica/OMSimulator": "2940ef11c2316c167bc78618d89de085b7cac52f",
    "pyssporg/pyssp_standard": "efe0e0ec4c70a66f363a6613cce16af4f7ac2757",
    "jkCXf9X4/ssp4sim": "e1ddd31031a4a107ef2766c5cce20e3bba70011a",
    "grouperenault/fmu_manipulation_toolbox": "e65eccba3701869f09b208ddb823d90c5fb40124",
    "INTO-CPS-Association/maestro": "64ca0ce55c36f5180adec86d4f89cd280f164799",
    "CATIA-Systems/FMPy": "e8b71b702fb4a5b6b63db9ef934f6dbb29816be6",
    "modelon-community/PyFMI": "b704ebd099f4cd988fd2c6845808528498f2de1d",
    "LBNL-ETA/SimulatorToFMU": "607d29ce2a6a54cce71fbca01515b7beb698f555",
}

#: Suffixes of files to collect, and of files within a folder that is an archive.
_FMU, _SSP, _STRUCTURE = ".fmu", ".ssp", ".ssd"

#: The structure that is run; a folder's others are variants of it.
DEFAULT = "SystemStructure.ssd"

#: List of the collected files, in the same folder.
_LIST = "collected.json"

#: A zip's time, the same for all: what is in a folder makes the archive, not when it was cloned.
_TIME = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Item:
    """A third-party FMU or archive.

    Attributes:
        place: repository that has it.
        path: there; a folder's is that of its structure.
        file: here, relative to the folder into which it was collected; empty: it could not be had.
        copies: how many others are the same, in this place or another.

    """

    place: str
    path: str
    file: str
    copies: int = 0

    @property
    def name(self) -> str:
        """Repository and path."""
        return f"{self.place}/{self.path}"

    @property
    def is_fmu(self) -> bool:
        """True for an FMU, false for an archive."""
        return self.path.endswith(_FMU)

    def fmi(self, folder: Path) -> str:
        """Version of FMI in its description; empty if there is none, or if it cannot be read.

        Args:
            folder: into which it was collected.

        """
        try:
            with ZipFile(folder / self.file) as archive:
                text = archive.read("modelDescription.xml").decode(errors="replace")
        except (OSError, KeyError, BadZipFile):
            return ""
        match = re.search(r"fmiVersion\s*=\s*[\"']([^\"']*)", text)
        return match[1] if match else ""


def collect(folder: Path) -> list[Item]:
    """Clone all repositories, and store their files in a folder.

    Args:
        folder: that keeps the clones and the files; what it has is not fetched again.

    """
    by_key: dict[str, Item] = {}
    for place, commit in PLACES.items():
        for item, content in _items(_Clone(folder / "clones" / place, place, commit)):
            key = hashlib.sha256(content).hexdigest() if content is not None else item.name
            if key in by_key:
                by_key[key] = replace(by_key[key], copies=by_key[key].copies + 1)
                continue
            by_key[key] = item
            if content is not None:
                file = folder / item.file
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
    items = list(by_key.values())
    text = json.dumps([asdict(item) for item in items], indent=1)
    (folder / _LIST).write_text(text, encoding="utf-8")
    return items


def collected(folder: Path) -> list[Item]:
    """Files that :func:`collect` has stored before."""
    return [Item(**item) for item in json.loads((folder / _LIST).read_text(encoding="utf-8"))]


class _Clone:
    """A repository at one commit, whose files are read one by one."""

    def __init__(self, folder: Path, place: str, commit: str) -> None:
        """Clone the repository, unless it is there."""
        self.place, self._folder, self._commit = place, folder, commit
        if not folder.is_dir():
            # Without the files: a few of them are wanted, and git fetches those when they are read.
            options = ["--bare", "--quiet", "--filter=blob:none"]
            address = f"https://github.com/{place}"
            subprocess.run(["git", "clone", *options, address, str(folder)], check=True)
        self.paths = self._git("ls-tree", "-r", "-z", "--name-only", commit).decode().split("\0")

    def read(self, path: str) -> bytes | None:
        """Content of a file; None if it is not available."""
        try:
            return self._git("show", f"{self._commit}:{path}")
        except subprocess.CalledProcessError:
            return None

    def _git(self, *arguments: str) -> bytes:
        command = ["git", "-C", str(self._folder), *arguments]
        return subprocess.run(command, check=True, capture_output=True).stdout


def _items(clone: _Clone) -> Iterator[tuple[Item, bytes | None]]:
    """Files of a repository with their content; None if it is not available."""
    structures: dict[PurePosixPath, list[str]] = {}
    for path in map(PurePosixPath, clone.paths):
        if path.suffix in (_FMU, _SSP):
            content = clone.read(str(path))
            kind = "fmus" if path.suffix == _FMU else "archives"
            file = "" if content is None else f"{kind}/{clone.place}/{path}"
            yield Item(clone.place, str(path), file), content
            if path.suffix == _SSP and content is not None:
                yield from _inside(clone, path, content)
        elif path.suffix == _STRUCTURE:
            structures.setdefault(path.parent, []).append(path.name)
    for parent, names in structures.items():
        files = dict(_archived(clone, parent, set(structures)))
        for name in names:
            # A variant is named as one only by tools: here it takes the default's place.
            content = _zipped({**files, DEFAULT: files[name]})
            path = parent / name
            yield Item(clone.place, str(path), f"archives/{clone.place}/{path}{_SSP}"), content


def _inside(clone: _Clone, path: PurePosixPath, content: bytes) -> Iterator[tuple[Item, bytes]]:
    """The FMUs in an archive."""
    with ZipFile(BytesIO(content)) as archive:
        for name in archive.namelist():
            if name.endswith(_FMU):
                within = f"{path}/{name}"
                file = f"fmus/{clone.place}/{within}"
                yield Item(clone.place, within, file), archive.read(name)


def _archived(
    clone: _Clone, parent: PurePosixPath, folders: set[PurePosixPath]
) -> Iterator[tuple[str, bytes]]:
    """Files of an archive that is a folder, without other archives in it."""
    for path in map(PurePosixPath, clone.paths):
        nearest = next((p for p in path.parents if p in folders), None)
        if (
            nearest == parent
            and path.suffix != _SSP
            and (content := clone.read(str(path))) is not None
        ):
            yield str(path.relative_to(parent)), content


def _zipped(files: Mapping[str, bytes]) -> bytes:
    stream = BytesIO()
    with ZipFile(stream, "w") as archive:
        for name, content in sorted(files.items()):
            archive.writestr(ZipInfo(name, _TIME), content, ZIP_DEFLATED)
    return stream.getvalue()
