"""Make up for what PythonFMU 0.7 does to the interpreter each time it creates an instance.

It imports the slave's script, then runs its source once more in the module's namespace, and
both times lets go of a reference to that namespace that it does not own. After some dozens of
instances the namespace would be freed under the running process. It also puts the resources
folder on sys.path and never takes it off.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path
from typing import Any


def settle(namespace: dict[str, Any]) -> None:
    """To be called by the script of a slave, as its last statement, with its `globals()`.

    Gives back the reference that PythonFMU is about to drop, and takes the resources folder off
    sys.path: everything the slave needs has been imported by now.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(namespace))
    if sys.path and _resources_of(sys.path[0], namespace["__name__"]):
        del sys.path[0]


def _resources_of(folder: str, script: str) -> bool:
    try:
        return Path(folder, "slavemodule.txt").read_text(encoding="utf-8").strip() == script
    except OSError:
        return False
