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

#: Factors whose product passes through the smallest numbers, and is rounded up and down: with
#: another mode it is another one.
A, B, C, PRODUCT = 1e-308, 0.1, 1e300, 1.000000000000002e-09

#: More bytes than any machine needs for its mode.
_SIZE = 1024

#: Modules that FMUs in Python share with this program; what they add to them is theirs.
_MODULES = (builtins, json, os, np)


_take_default, _get, _set = floating_point_calls()


def restore_mode() -> None:
    """Take on the default mode after a call of an FMU, if numbers are others in the present one.

    Looking costs a third of changing it.
    """
    if A * B * C != PRODUCT:
        _take_default()


@contextmanager
def default_mode() -> Iterator[None]:
    """Compute in the default mode, and restore the one that was there."""
    before = ctypes.create_string_buffer(_SIZE)
    _get(before)
    _take_default()
    try:
        yield
    finally:
        _set(before)


class Surroundings:
    """The current folder, the standard streams, and what modules hold.

    FMUs may change them during a run, and find them as they left them, so that
    nothing depends on when this program looks after its files.
    """

    def __init__(self) -> None:
        """Remember what is there before an FMU is loaded."""
        self._process = os.getpid()
        # Another thread than the main one shares it all with others, which may change it, too.
        self._is_ours = threading.current_thread() is threading.main_thread()
        self._modules = [(vars(module), dict(vars(module))) for module in _MODULES]
        self._streams = sys.stdin, sys.stdout, sys.stderr
        self._folder, self._status = Path(), os.stat(".")  # noqa: PTH116  # a third of the time
        # It may have been deleted: then there is nothing to go back to.
        with suppress(OSError):
            self._folder = Path.cwd()

    @contextmanager
    def ours(self) -> Iterator[None]:
        """For a while, have streams and folder as they were; never in a copy of the process."""
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
        """Put all back as it was; never in a copy of the process."""
        self.end_copy()
        if self._is_ours:
            for now, before in self._modules:
                now.update(before)
            self._left()
            sys.stdin, sys.stdout, sys.stderr = self._streams
            for number, name in enumerate(("stdin", "stdout", "stderr")):
                # Closed in Python, where the descriptor stays open.
                if getattr(getattr(sys, name), "closed", False):
                    setattr(sys, name, open(number, "w" if number else "r", closefd=False))  # noqa: SIM115

    def end_copy(self) -> None:
        """End a copy that an FMU has made of this process: two would write into the same files."""
        if os.getpid() != self._process:
            os._exit(0)

    def _left(self) -> Path | None:
        """Go back to the folder of before; gives the one that is left, if it is another."""
        with suppress(OSError):
            if not os.path.samestat(os.stat("."), self._status):  # noqa: PTH116
                folder = Path.cwd()
                os.chdir(self._folder)
                return folder
        return None

    def __enter__(self) -> Surroundings:
        """Let FMUs begin."""
        return self

    def __exit__(self, *_: object) -> None:
        """Put back what they have changed."""
        self.put_back()


@contextmanager
def within_folder(folder: Path) -> Iterator[None]:
    """Make a folder the current one for a while; the one before may have been deleted."""
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
