"""Which components there are: every folder that declares ports."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from fmus.ports.port import Port


def package_folder(package: str) -> Path:
    """Where an installed package is."""
    [folder] = import_module(package).__path__
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
