"""Parts of this process that FMUs may change, such as its floating-point mode, and their repair."""

from __future__ import annotations

import builtins
import ctypes
import json
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import chdir, contextmanager, suppress
from pathlib import Path

import numpy as np

from orchestrator.machine.operating_system import floating_point_calls

#: Factors whose product passes through subnormal numbers and is rounded up and down: it differs in
#: any other mode.
A, B, C, PRODUCT = 1e-308, 0.1, 1e300, 1.000000000000002e-09

#: Upper limit for the size of the mode [bytes].
_SIZE = 1024

#: Modules that FMUs in Python share with this program; they may add names to them.
_MODULES = (builtins, json, os, np)


_take_default, _get, _set = floating_point_calls()


def restore_mode() -> None:
    """Restore the default mode after a call of an FMU, if the present mode computes differently.

    Testing takes a third of the time of setting it.
    """
    if A * B * C != PRODUCT:
        _take_default()


@contextmanager
def default_mode() -> Iterator[None]:
    """Compute in the default mode, and restore the previous one at the end."""
    before = ctypes.create_string_buffer(_SIZE)
    _get(before)
    _take_default()
    try:
        yield
    finally:
        _set(before)


class Surroundings:
    """The current folder, the standard streams, and the contents of some modules.

    FMUs may change them during a run, and find them as they left them, so that nothing depends on
    the moments at which this program uses its files.
    """

    def __init__(self) -> None:
        """Save the present state, before an FMU is loaded."""
        self._process = os.getpid()
        # A thread other than the main one shares all of this with threads that may change it.
        self._is_ours = threading.current_thread() is threading.main_thread()
        self._modules = [(vars(module), dict(vars(module))) for module in _MODULES]
        self._streams = sys.stdin, sys.stdout, sys.stderr
        self._folder, self._status = Path(), os.stat(".")  # noqa: PTH116  # a third of the time
        # A deleted folder cannot be restored.
        with suppress(OSError):
            self._folder = Path.cwd()

    @contextmanager
    def ours(self) -> Iterator[None]:
        """Restore streams and folder temporarily; a forked copy of the process ends here."""
        self.end_copy()
        if not self._is_ours:
            yield
            return
        streams, folder = (sys.stdin, sys.stdout, sys.stderr), self._left()
        sys.stdin, sys.stdout, sys.stderr = self._streams
        try:
            yield
        finally:
            sys.stdin, sys.stdout, sys.stderr = streams
            if folder is not None:
                with suppress(OSError):
                    os.chdir(folder)

    def put_back(self) -> None:
        """Restore everything; a forked copy of the process ends here."""
        self.end_copy()
        if self._is_ours:
            for now, before in self._modules:
                now.update(before)
            self._left()
            sys.stdin, sys.stdout, sys.stderr = self._streams
            for number, name in enumerate(("stdin", "stdout", "stderr")):
                # Closed in Python; the descriptor is still open.
                if getattr(getattr(sys, name), "closed", False):
                    setattr(sys, name, open(number, "w" if number else "r", closefd=False))  # noqa: SIM115

    def end_copy(self) -> None:
        """End a copy that an FMU has forked: both would write into the same files."""
        if os.getpid() != self._process:
            os._exit(0)

    def _left(self) -> Path | None:
        """Return to the saved folder, and return the folder that is left, if it differs."""
        with suppress(OSError):
            if not os.path.samestat(os.stat("."), self._status):  # noqa: PTH116
                folder = Path.cwd()
                os.chdir(self._folder)
                return folder
        return None

    def __enter__(self) -> Surroundings:
        """Let FMUs start."""
        return self

    def __exit__(self, *_: object) -> None:
        """Restore the process."""
        self.put_back()


@contextmanager
def within_folder(folder: Path) -> Iterator[None]:
    """Change the current folder temporarily; the previous one may have been deleted."""
    if not hasattr(os, "fchdir"):
        with chdir(folder):
            yield
        return
    before = os.open(".", getattr(os, "O_PATH", os.O_RDONLY))
    try:
        os.chdir(folder)
        yield
    finally:
        os.fchdir(before)
        os.close(before)
