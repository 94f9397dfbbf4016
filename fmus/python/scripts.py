"""Mistakes in a user's script: told with file and line, and kept from PythonFMU.

PythonFMU answers an exception with fmi2Fatal, and its message has no line. A slave on the base of
this package raises none; what a plain one raises is caught here.
"""

from __future__ import annotations

import re
import traceback
from functools import wraps
from pathlib import Path
from typing import Any, Callable, TypeVar

from pythonfmu.enums import Fmi2Status

from fmus.python.loading import ANSWER, has_loader
from fmus.python.store import MISSING

Slave = TypeVar("Slave", bound=type)

#: What sealing has put after the name of every module in the FMU; empty: this is not in one.
_SEAL = "".join(re.findall(r"_[0-9a-f]{12}$", __name__.partition(".")[0]))

#: Packages that are in an FMU beside the user's script.
_OURS = tuple(f"{package}{_SEAL}" for package in ("fmus", "auv_fmu", "pythonfmu"))

#: What is answered in the place of values that could not be had.
_MISSING = {f"get_{kind.lower()}": value for kind, value in MISSING.items()}

_CALLS = (
    "setup_experiment",
    "enter_initialization_mode",
    "exit_initialization_mode",
    "terminate",
    *(f"set_{kind.lower()}" for kind in MISSING),
    *_MISSING,
)


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
            _tell(self, error, f"step refused at t = {current_time:g} s: ")
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
                _tell(self, error)
            self._raised = True
            if has_loader(self.resources):
                self.log("", Fmi2Status.error, ANSWER)
            return [_MISSING[name]] * len(arguments[0]) if name in _MISSING else None

    return call


def _tell(slave: Any, error: BaseException, what: str = "") -> None:
    text = f"{what}{place(error)}{type(error).__name__}: {error}"
    # FMI defines a log message as a format: a host would take a % for a directive.
    slave.log(text.replace("%", "%%"), Fmi2Status.error)
