"""Make up for what PythonFMU 0.7 does to the process each time it creates an instance.

- It imports the slave's script, then runs its source once more in the module's namespace, and
  then lets go of a reference to that namespace that it does not own. After some dozens of
  instances the namespace would be freed under the running process.
- It puts the resources folder on sys.path and never takes it off.
- Its library frees the object that watches over the interpreter twice when the process ends,
  which now and then ends in "corrupted double-linked list" and an exit status of 134.
"""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from typing import Any


def settle(namespace: dict[str, Any]) -> None:
    """To be called by the script of a slave, as its last statement, with its `globals()`.

    Everything the slave needs has been imported by now.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(namespace))
    if sys.path and _resources_of(sys.path[0], namespace["__name__"]):
        _release_interpreter(Path(sys.path.pop(0)))


def _resources_of(folder: str, script: str) -> bool:
    try:
        return Path(folder, "slavemodule.txt").read_text(encoding="utf-8").strip() == script
    except OSError:
        return False


def _release_interpreter(resources: Path) -> None:
    """Free the library's watch over the interpreter now, so that the end of the process cannot.

    Only where the process is Python's own. Otherwise the library has started the interpreter
    itself, and freeing its watch would end it.
    """
    if not any(getattr(sys, "orig_argv", sys.argv)):
        return
    for library in resources.parent.glob("binaries/linux64/*.so"):
        try:
            loaded = ctypes.CDLL(str(library), mode=os.RTLD_LAZY | os.RTLD_NOLOAD)
            loaded.finalizePythonInterpreter()
        except (OSError, AttributeError):
            # Not the library that runs this instance, or one that has no such function.
            continue
