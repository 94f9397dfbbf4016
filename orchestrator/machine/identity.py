"""Identities of runs: everything that determines their numbers, and digests of code."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

#: Packages whose versions determine the rows of a run.
PACKAGES = ("auv-fmu", "pythonfmu", "fmpy", "numpy")

#: Suffixes of sources in Python, C and CUDA.
_SOURCES = (".c", ".cu", ".cuh", ".h", ".py")

#: Everything that determines the numbers of a run, as texts by their names.
Identity = Mapping[str, str]


def differences(first: Identity, second: Identity) -> list[str]:
    """Return the sorted names of the entries in which two identities differ."""
    return sorted(dict(first.items() ^ second.items()))


def digest_of(*identities: Identity) -> str:
    """Return the SHA-256 of identities, in their order."""
    return sha256(json.dumps(identities, sort_keys=True).encode()).hexdigest()


def package_folder(package: str) -> Path:
    """Return the folder of an installed package; only its parent packages are imported."""
    specification = find_spec(package)
    assert specification is not None and specification.submodule_search_locations
    [folder] = specification.submodule_search_locations
    return Path(folder)


@cache
def code_of(*packages: str) -> str:
    """Return a digest of the sources of packages."""
    digest = sha256()
    for package in packages:
        root = package_folder(package)
        sources = (path for path in root.rglob("*") if path.suffix in _SOURCES)
        for path in sorted(sources):
            digest.update(f"{package}/{path.relative_to(root).as_posix()}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()
