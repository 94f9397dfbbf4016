"""The process that starts the processes of isolated FMUs, and leaves none behind.

It runs nothing foreign itself, so that it can be relied on where they crash, hang, or write
without end; and it outlives the process that has started it for as long as that takes.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import socket
import sys
import warnings
from codecs import getincrementaldecoder
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import PIPE, Popen, TimeoutExpired
from time import monotonic
from typing import Any

from orchestrator.cosim.fmi.isolated import FAREWELL
from orchestrator.cosim.fmi.worker import serve
from orchestrator.cosim.system.component import Component
from orchestrator.machine.errors import escape_unprintable
from orchestrator.machine.operating_system import die_with_parent

#: Written to the supervisor to end all processes; so does the end of its input.
_END = b"."

#: What an FMU may write to its standard output and error [bytes]; more is not shown.
_MOST_OUTPUT = 1 << 16

#: What a pipe holds, and what it takes at once if it takes anything [bytes].
_PIPE, _PIECE = 1 << 16, 1 << 12

#: How often it looks whether its parent is still there [ms].
_PATIENCE = 500

#: What the supervisor begins with: the modules that this process would find, and no main module.
_BEGIN = """
import importlib, json, sys
order = json.loads(sys.stdin.buffer.raw.readline())
sys.path[:] = order["path"]
importlib.import_module("orchestrator.cosim.fmi.supervisor").supervise(order)
"""


class Supervisor:
    """The supervisor, as the process knows it that starts it."""

    def __init__(
        self, components: Mapping[str, Component], connections: Sequence[socket.socket]
    ) -> None:
        """Start it, with a socket for the process of each component.

        Raises:
            OSError: it cannot be started.

        """
        folders = [component.folder for component in components.values()]
        descriptors = [connection.fileno() for connection in connections]
        order = {
            "path": [entry for entry in sys.path if isinstance(entry, str)],
            "temporary": sorted({str(folder.parent) for folder in folders}),
            "components": [
                (component.name, str(component.fmu), component.digest, str(folder), descriptor)
                for component, folder, descriptor in zip(
                    components.values(), folders, descriptors, strict=True
                )
            ],
        }
        self._process = Popen(
            [sys.executable, "-P", "-c", _BEGIN],
            stdin=PIPE,
            stdout=PIPE,
            bufsize=0,
            pass_fds=descriptors,
            start_new_session=True,
        )
        self._statuses: dict[int, int] = {}
        self._text = b""
        self._write(json.dumps(order).encode() + b"\n")

    def status(self, number: int, patience: float) -> int | None:
        """Exit status of the process of a component, for which it waits some seconds.

        Returns:
            None: it has not ended.

        """
        due = monotonic() + patience
        reports = self._process.stdout
        assert reports is not None
        ready = select.poll()
        ready.register(reports)
        while number not in self._statuses and (left := due - monotonic()) > 0.0:
            if ready.poll(1000.0 * left):
                text = os.read(reports.fileno(), 4096)
                if not text:
                    # Its children die with the supervisor.
                    return -signal.SIGKILL
                *lines, self._text = (self._text + text).split(b"\n")
                for line in lines:
                    ended, exit_status = map(int, line.split())
                    self._statuses[ended] = exit_status
        return self._statuses.get(number)

    def end(self) -> None:
        """End all processes that are left."""
        self._write(_END)
        try:
            self._process.wait(FAREWELL)
        except TimeoutExpired:
            self._process.kill()
        with self._process:
            pass

    def _write(self, text: bytes) -> None:
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.write(text)


def supervise(order: dict[str, Any]) -> None:
    """Run each component in a process, until all have ended or their run has.

    Reads :data:`_END` from the standard input, and writes a line with the number of a component
    and its exit status to the standard output when its process has ended.

    Args:
        order: `components`, each with its name, FMU, digest, folder and the descriptor of a socket,
            and `temporary`, folders that no other process removes if the parent is killed.

    """
    parent = os.getppid()
    # Whether to stop is for the parent to decide.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    children = _Children()
    for name, fmu, digest, folder, descriptor in order["components"]:
        if children.start(name):
            serve(name, Path(fmu), digest, Path(folder), _alone_with(descriptor))
            return
        os.close(descriptor)
    if not children.watched(parent):
        for folder in order["temporary"]:
            shutil.rmtree(folder, ignore_errors=True)


def _alone_with(descriptor: int) -> socket.socket:
    """In a new process: keep one socket and the standard streams, and die with the supervisor."""
    os.dup2(descriptor, 3)
    os.set_inheritable(3, False)
    os.closerange(4, os.sysconf("SC_OPEN_MAX"))
    die_with_parent()
    return socket.socket(fileno=3)


class _Captured:
    """What the process of a component writes to its standard output and error."""

    def __init__(self, name: str, descriptor: int) -> None:
        self._name, self._descriptor = name, descriptor
        self._left = _MOST_OUTPUT
        # A letter may come in two pieces.
        self._decoded = getincrementaldecoder("utf-8")("backslashreplace").decode
        os.set_blocking(descriptor, False)

    def forward(self) -> None:
        """Show the text that has arrived, if it is not too much."""
        with suppress(BlockingIOError):
            text = os.read(self._descriptor, _PIPE)
            if self._left > 0:
                shown = escape_unprintable(self._decoded(text[: self._left]), "\n\t")
                _show(shown.encode())
                self._left -= len(text)
                if self._left <= 0:
                    _show(f"\nauv-fmu: {self._name}: further output is not shown\n".encode())


class _Children:
    """The processes of the components."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        self._outputs: dict[int, _Captured] = {}
        # A child that ends interrupts the poll through this pipe.
        self._ends, end = os.pipe()
        os.set_blocking(end, False)
        signal.set_wakeup_fd(end, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        self._poll = select.poll()
        for descriptor in (0, self._ends):
            self._poll.register(descriptor, select.POLLIN)

    def start(self, name: str) -> bool:
        """Start one more; true in the new process."""
        reading, writing = os.pipe()
        with warnings.catch_warnings():
            # That numpy may have threads: this process computes nothing.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        # A separate group, so that whatever it starts can be ended with it.
        with suppress(OSError):
            os.setpgid(pid, pid)
        if pid == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            for stream in (1, 2):
                os.dup2(writing, stream)
            return True
        os.close(writing)
        self._numbers[pid] = len(self._numbers)
        self._outputs[reading] = _Captured(name, reading)
        self._poll.register(reading, select.POLLIN)
        return False

    def watched(self, parent: int) -> bool:
        """Wait until all have ended or are to end; whether the parent is still there."""
        while self._numbers:
            for descriptor, event in self._poll.poll(_PATIENCE):
                if descriptor == 0:
                    there = os.read(0, 1) == _END
                    self._kill()
                    return there
                if descriptor == self._ends:
                    os.read(self._ends, _PIPE)
                elif event & select.POLLIN:
                    self._outputs[descriptor].forward()
                else:
                    self._poll.unregister(descriptor)
            if os.getppid() != parent:
                self._kill()
                return False
            self._reap()
        return True

    def _reap(self) -> None:
        while self._numbers and (
            ended := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        ):
            pid = ended.si_pid
            _kill_group(pid)
            _, status = os.waitpid(pid, 0)
            for output in self._outputs.values():
                output.forward()
            number = self._numbers.pop(pid)
            with suppress(OSError):
                os.write(1, b"%d %d\n" % (number, os.waitstatus_to_exitcode(status)))

    def _kill(self) -> None:
        for pid in self._numbers:
            _kill_group(pid)


def _kill_group(pid: int) -> None:
    with suppress(OSError):
        os.killpg(pid, signal.SIGKILL)


def _show(text: bytes) -> None:
    """Write to the standard error, unless it is closed."""
    with suppress(OSError):
        for first in range(0, len(text), _PIECE):
            _, ready, _ = select.select([], [2], [], 0)
            if ready:
                os.write(2, text[first : first + _PIECE])
