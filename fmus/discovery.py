"""Which components there are: every folder with a slave."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path


def package_folder(package: str) -> Path:
    """Where an installed package is."""
    [folder] = import_module(package).__path__
    return Path(folder)


def components() -> dict[str, str]:
    """Class name of every component and the module of its slave: one a folder."""
    return {
        "".join(word.capitalize() for word in slave.parent.name.split("_")): (
            f"fmus.{slave.parent.name}.slave"
        )
        for slave in sorted(package_folder("fmus").glob("*/slave.py"))
    }


def folder_of(module: str) -> Path:
    """The folder of a component, from the module of its slave."""
    return package_folder("fmus") / module.split(".")[1]
