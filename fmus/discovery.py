"""What there is to build FMUs from: every folder that declares ports, and all that they need."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from fmus.archive import licences
from fmus.kinds import CONTAINED
from fmus.ports.port import Port


def package_folder(package: str) -> Path:
    """Where an installed package is; only the packages that it lies in are imported."""
    specification = find_spec(package)
    assert specification is not None and specification.submodule_search_locations
    [folder] = specification.submodule_search_locations
    return Path(folder)


def components() -> dict[str, str]:
    """The name of every component, and the package that its folder is."""
    return {
        "".join(word.capitalize() for word in ports.parent.name.split("_")): (
            f"fmus.{ports.parent.name}"
        )
        for ports in sorted(package_folder("fmus").glob("*/ports.py"))
    }


def ports_of(name: str) -> Sequence[Port]:
    """The ports of a component, all but `fault`."""
    ports: Sequence[Port] = import_module(f"{components()[name]}.ports").PORTS
    return ports


def fingerprint(kind: str) -> str:
    """Hash of everything installed that FMUs of a kind depend on, except a C compiler."""
    digest = hashlib.sha256()
    for package in ("auv_fmu", "fmus", *CONTAINED[kind]):
        root = package_folder(package)
        for path in sorted(root.rglob("*")):
            name = path.relative_to(root)
            # The first is Python's own, the second what was built of them.
            if path.is_file() and path.suffix != ".pyc" and name.parts[0] != "dist":
                digest.update(f"{package}/{name}\0".encode())
                digest.update(path.read_bytes())
    for text in (licences(kind), version("markdown-it-py")):
        digest.update(text.encode())
    return digest.hexdigest()
