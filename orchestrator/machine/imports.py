"""Modules that would read a file of the current folder when they are imported.

That file may be of somebody else: what a study or a scenario came with.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path

from orchestrator.machine.locks import process_folder


def imported_apart(module: str, file: str) -> None:
    """Import a module now, and elsewhere, if the current folder has a file that it would read.

    Args:
        module: to be imported.
        file: that it looks for in the current folder.

    """
    if module in sys.modules or not os.path.lexists(file):
        return
    current = Path.cwd()
    os.chdir(process_folder())
    try:
        import_module(module)
    finally:
        os.chdir(current)
