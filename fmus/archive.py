"""FMU files of both kinds: reproducible archives, and the licences in them."""

from __future__ import annotations

import hashlib
import uuid
import zipfile
from collections.abc import Mapping
from importlib.metadata import distribution
from pathlib import Path

from fmus.kinds import CONTAINED

#: The oldest time a zip archive can hold: the time of a build is no part of its result.
_EPOCH = (1980, 1, 1, 0, 0, 0)


def write_archive(path: Path, entries: dict[str, bytes]) -> None:
    """Write a zip archive whose bytes depend on nothing but its entries, all at once."""
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        with zipfile.ZipFile(partial, "w") as archive:
            for name in sorted(entries):
                info = zipfile.ZipInfo(name, _EPOCH)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.create_system = 3
                info.external_attr = 0o644 << 16
                archive.writestr(info, entries[name], compresslevel=9)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


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


def licences(kind: str) -> str:
    """Licence of the bundle, and of what else FMUs of a kind contain."""
    heads = {"auv-fmu": "auv-fmu", "pythonfmu": "PythonFMU, contained in resources and binaries"}
    return "\n\n".join(
        f"{heads[package]}\n\n{distribution(package).read_text('licenses/LICENSE') or ''}"
        for package in ("auv-fmu", *CONTAINED[kind])
    )
