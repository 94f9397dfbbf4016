"""Progress bars, on a terminal and in a notebook."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from typing import Any


def progress_bar(**options: Any) -> Any:
    """A bar of tqdm: a widget in a notebook that has widgets, else a line on a terminal."""
    is_widget = "ipykernel" in sys.modules and find_spec("ipywidgets") is not None
    return import_module("tqdm.notebook" if is_widget else "tqdm").tqdm(**options)
