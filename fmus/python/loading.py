"""Repair the effects of PythonFMU 0.7 on a process, and catch exceptions of users' scripts.

For each instance, PythonFMU imports the slave's script, then runs its source again, with the
module's namespace as the globals and a new one as the locals, and searches the locals for the
class.

- It releases a reference to the module's namespace that it does not own. After some dozens of
  instances the namespace would be freed in the running process.
- The search leaks an object for each base of each class in the locals: more than a kilobyte for
  each instance.
- It puts the resources folder on sys.path and never removes it, and leaks the path.
- It ends the process if a message or string cannot be encoded.
- Its library frees the guard of the interpreter twice when the process ends, which sometimes gives
  "corrupted double-linked list" and an exit status of 134.

It answers an exception with fmi2Fatal, and its message has no line. Slaves derived from the base
class of this package raise no exceptions; exceptions of other slaves are caught here, and reported
with file and line.
"""

from __future__ import annotations

import ctypes
import os
import re
import sys
import traceback
from functools import wraps
from pathlib import Path
from typing import Any, Callable, TypeVar

from pythonfmu.enums import Fmi2Status

#: Category of log entries that pass the status of a call to the native loader.
ANSWER = "answer"

#: Results in place of values that could not be read.
MISSING: dict[str, Any] = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}

#: The same, by callback.
_INSTEAD = {f"get_{kind.lower()}": value for kind, value in MISSING.items()}

#: Callbacks whose exceptions are caught; a step has a wrapper of its own.
_CALLS = (
    "setup_experiment",
    "enter_initialization_mode",
    "exit_initialization_mode",
    "terminate",
    *(f"set_{kind.lower()}" for kind in MISSING),
    *_INSTEAD,
)

#: Suffix that sealing added to the names of all modules in the FMU; empty outside of FMUs.
_SEAL = "".join(re.findall(r"_[0-9a-f]{12}$", __name__.partition(".")[0]))

#: Packages in an FMU that are not the user's.
_OURS = tuple(f"{package}{_SEAL}" for package in ("fmus", "auv_fmu", "pythonfmu"))

Slave = TypeVar("Slave", bound=type)


def settle(slave: type, module: dict[str, Any], found: dict[str, Any]) -> None:
    """Prepare the search for the slave: the last statement of its script.

    Args:
        slave: the class that PythonFMU is to find.
        module: `globals()` of the script.
        found: `locals()` of the script.

    """
    # If the search finds no class, PythonFMU takes the module's attribute with the empty name.
    module[""] = slave
    if found is module:
        _make_encodable(slave)
        return
    found.clear()
    # Restore the reference that PythonFMU releases, and below drop the one that it leaks.
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(module))
    # Other threads may insert and remove other folders.
    script = module["__name__"]
    path = next((folder for folder in [*sys.path] if _resources_of(folder, script)), None)
    if path is not None:
        sys.path.remove(path)
        _release_interpreter(Path(path))
        fresh = f"{path}/"
        if sys.getrefcount(path) == sys.getrefcount(fresh) + 1:
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(path))


def _make_encodable(slave: Any) -> None:
    """Make a slave's class log and return only text that can be encoded."""
    log, get_string = slave.log, slave.get_string

    def clear_log(self: Any, msg: object, *args: Any, **kwargs: Any) -> None:
        log(self, _encodable(msg), *args, **kwargs)

    def clear_get_string(self: Any, vrs: list[int]) -> list[str]:
        return [_encodable(value) for value in get_string(self, vrs)]

    slave.log, slave.get_string = clear_log, clear_get_string


def _encodable(text: object) -> str:
    return str(text).encode("utf-8", "replace").decode("utf-8")


def has_loader(resources: str | None) -> bool:
    """Return True if the FMU with a folder of resources has the native loader."""
    return (
        resources is not None
        and sys.platform.startswith("linux")
        and any(Path(resources).parent.glob("binaries/linux64/*_pythonfmu.so"))
    )


def _resources_of(folder: str, script: str) -> bool:
    try:
        return Path(folder, "slavemodule.txt").read_text(encoding="utf-8").strip() == script
    except (OSError, ValueError):
        return False


def _release_interpreter(resources: Path) -> None:
    """Free the library's guard of the interpreter now, so that it is not freed twice at the end.

    This is only for Python processes. In other processes the library has started the interpreter,
    and freeing the guard would end it.
    """
    if not any(getattr(sys, "orig_argv", sys.argv)):
        return
    for library in resources.parent.glob("binaries/linux64/*.so"):
        try:
            # PyDLL keeps the interpreter lock: another thread may be making an instance.
            loaded = ctypes.PyDLL(str(library), mode=os.RTLD_LAZY | os.RTLD_NOLOAD)
            loaded.finalizePythonInterpreter()
        except (OSError, AttributeError):
            # Another library than the one that runs this instance, or one without the function.
            continue


def place(error: BaseException) -> str:
    """Return the place of an error in a user's script, as `script.py:12: `, or an empty text."""
    if not _SEAL:
        return ""
    places = [
        f"{Path(frame.f_code.co_filename).name.replace(_SEAL, '')}:{line}: "
        for frame, line in traceback.walk_tb(error.__traceback__)
        for package in [str(frame.f_globals.get("__name__")).partition(".")[0]]
        if package.endswith(_SEAL) and package not in _OURS
    ]
    return places[-1] if places else ""


def caught(slave: Slave) -> Slave:
    """Make a slave's class catch its exceptions; after one, all steps are discarded."""
    if any(base.__module__.partition(".")[0] == _OURS[0] for base in slave.__mro__):
        return slave
    for name in _CALLS:
        setattr(slave, name, _catching(getattr(slave, name), name))
    do_step: Any = slave.do_step  # type: ignore[attr-defined]

    @wraps(do_step)
    def do_caught_step(self: Any, current_time: float, step_size: float) -> bool:
        if hasattr(self, "_raised"):
            return False
        try:
            return bool(do_step(self, current_time, step_size))
        except BaseException as error:
            _log_error(self, error, f"step refused at t = {current_time:g} s: ")
            return False

    slave.do_step = do_caught_step  # type: ignore[attr-defined]
    return slave


def _catching(method: Callable[..., Any], name: str) -> Callable[..., Any]:
    @wraps(method)
    def call(self: Any, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except BaseException as error:
            if not hasattr(self, "_raised"):
                _log_error(self, error)
            self._raised = True
            if has_loader(self.resources):
                self.log("", Fmi2Status.error, ANSWER)
            return [_INSTEAD[name]] * len(arguments[0]) if name in _INSTEAD else None

    return call


def _log_error(slave: Any, error: BaseException, what: str = "") -> None:
    text = f"{what}{place(error)}{type(error).__name__}: {error}"
    # In FMI a log message is a format string, so each % is doubled.
    slave.log(text.replace("%", "%%"), Fmi2Status.error)
