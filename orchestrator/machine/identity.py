"""Identities of runs: what decides their numbers, and the digest of code."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

#: Packages whose versions the rows depend on.
PACKAGES = ("auv-fmu", "pythonfmu", "fmpy", "numpy")

#: All that decides the numbers of a run: by names in words, each as text.
Identity = Mapping[str, str]


def differences(one: Identity, other: Identity) -> list[str]:
    """What makes two runs two, by the names of an identity."""
    return sorted(dict(one.items() ^ other.items()))


def digest_of(*identities: Identity) -> str:
    """An identity, or several in their order, as a short text."""
    return sha256(json.dumps(identities, sort_keys=True).encode()).hexdigest()


@cache
def code_of(*packages: str) -> str:
    """Digest of the code of some packages, in Python and C."""
    digest = sha256()
    for package in packages:
        specification = find_spec(package)
        assert specification is not None and specification.submodule_search_locations
        [root] = specification.submodule_search_locations
        found = (path for path in Path(root).rglob("*") if path.suffix in (".c", ".h", ".py"))
        for path in sorted(found):
            digest.update(f"{package}/{path.relative_to(root).as_posix()}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()
