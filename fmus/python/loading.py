"""Make up for what PythonFMU 0.7 does to a process, and keep from it what a user's script raises.

Each time it creates an instance, it imports the slave's script, then runs its source once more,
with the module's namespace as the globals and a new one as the locals, and searches the locals for
the class.

- It lets go of a reference to the module's namespace that it does not own. After some dozens of
  instances the namespace would be freed under the running process.
- The search never frees what it makes of each base of each class it meets: more than a kilobyte
  an instance.
- It puts the resources folder on sys.path and never takes it off; it never frees the path either.
- It takes it for granted that messages and strings can be encoded, and otherwise ends the process.
- Its library frees the object that watches over the interpreter twice when the process ends,
  which now and then ends in "corrupted double-linked list" and an exit status of 134.

It answers an exception with fmi2Fatal, and its message has no line. A slave on the base of this
package raises none; what a plain one raises is caught here and reported with file and line.
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

#: Category of a log entry by which the native loader learns the status of the call.
ANSWER = "answer"

#: The answer instead of values that could not be read.
MISSING: dict[str, Any] = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}

#: The same, by the callback that is asked for them.
_INSTEAD = {f"get_{kind.lower()}": value for kind, value in MISSING.items()}

#: Callbacks that are kept from raising; a step answers for itself.
_CALLS = (
    "setup_experiment",
    "enter_initialization_mode",
    "exit_initialization_mode",
    "terminate",
    *(f"set_{kind.lower()}" for kind in MISSING),
    *_INSTEAD,
)

#: What sealing has put after the name of every module in the FMU; empty: this is not in one.
_SEAL = "".join(re.findall(r"_[0-9a-f]{12}$", __name__.partition(".")[0]))

#: Packages that are in an FMU beside the user's script.
_OURS = tuple(f"{package}{_SEAL}" for package in ("fmus", "auv_fmu", "pythonfmu"))

Slave = TypeVar("Slave", bound=type)


def settle(slave: type, module: dict[str, Any], found: dict[str, Any]) -> None:
    """To be called by the script of a slave, as its last statement, when all is imported.

    Args:
        slave: the class that PythonFMU shall find.
        module: `globals()` of the script.
        found: its `locals()`.

    """
    # A search that finds no class ends in the module's attribute with the empty name.
    module[""] = slave
    if found is module:
        _make_encodable(slave)
        return
    found.clear()
    # What is one reference short is given back, what has one too many is relieved of it.
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(module))
    # Other threads put other folders before it, and take them away.
    script = module["__name__"]
    path = next((folder for folder in [*sys.path] if _resources_of(folder, script)), None)
    if path is not None:
        sys.path.remove(path)
        _release_interpreter(Path(path))
        same_but_ours = f"{path}/"
        if sys.getrefcount(path) == sys.getrefcount(same_but_ours) + 1:
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(path))


def _make_encodable(slave: Any) -> None:
    """Make a class of slaves log and return only text that can be encoded."""
    log, get_string = slave.log, slave.get_string

    def clear_log(self: Any, msg: object, *args: Any, **kwargs: Any) -> None:
        log(self, _encodable(msg), *args, **kwargs)

    def clear_get_string(self: Any, vrs: list[int]) -> list[str]:
        return [_encodable(value) for value in get_string(self, vrs)]

    slave.log, slave.get_string = clear_log, clear_get_string


def _encodable(text: object) -> str:
    return str(text).encode("utf-8", "replace").decode("utf-8")


def has_loader(resources: str | None) -> bool:
    """Whether the native loader is between the host and the slave of a folder of resources."""
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
    """Free the library's watch over the interpreter now, so that the end of the process cannot.

    Only where the process is Python's own. Otherwise the library has started the interpreter
    itself, and freeing its watch would end it.
    """
    if not any(getattr(sys, "orig_argv", sys.argv)):
        return
    for library in resources.parent.glob("binaries/linux64/*.so"):
        try:
            # Under the interpreter lock: a thread may be making another instance.
            loaded = ctypes.PyDLL(str(library), mode=os.RTLD_LAZY | os.RTLD_NOLOAD)
            loaded.finalizePythonInterpreter()
        except (OSError, AttributeError):
            # Not the library that runs this instance, or one that has no such function.
            continue


def place(error: BaseException) -> str:
    """Where in a user's script an error was raised, as `script.py:12: `; empty: in none."""
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
    """A class of slaves that raise nothing: no step is taken after what they have raised."""
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
    # FMI defines a log message as a format: a host would take a % for a directive.
    slave.log(text.replace("%", "%%"), Fmi2Status.error)
