"""The components of examples/, as their tests load them."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from fmus.discovery import Source
from fmus.script import script_in, source_of_script

EXAMPLES = Path(__file__).parents[2] / "examples"

#: The names of all examples.
NAMES = sorted(path.stem for path in EXAMPLES.glob("*/*.py") if path.stem == path.parent.name)


def source(name: str) -> Source:
    """Source of an example's FMU, as `auv-fmu build` finds it."""
    return source_of_script(script_in(EXAMPLES / name))


def load(name: str) -> ModuleType:
    """The module of an example."""
    return import_module(source(name).module)
