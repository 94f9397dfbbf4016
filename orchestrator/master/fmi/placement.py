"""In which process each FMU runs: in this one, or in one that a supervisor starts for it."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from select import poll
from subprocess import PIPE, Popen, TimeoutExpired
from threading import Lock
from time import monotonic

from orchestrator.machine.errors import StartError, reason
from orchestrator.machine.interrupts import Interrupts
from orchestrator.master.fmi.binary import make_binary
from orchestrator.master.fmi.instance import Instance
from orchestrator.master.fmi.isolated import FAREWELL, IsolatedInstance, Isolation
from orchestrator.master.fmi.loaded import all_loaded
from orchestrator.master.fmi.log import Log
from orchestrator.master.fmi.supervisor import END
from orchestrator.system.component import Component

#: FMUs that allow one instance a process, and have it in this one, for runs in several threads.
_taken: set[str] = set()
_LOCK = Lock()

#: What the supervisor begins with: the modules that this process would find, and no main module.
_BEGIN = """
import json, sys
order = json.loads(sys.stdin.buffer.raw.readline())
sys.path[:] = order["path"]
from orchestrator.master.fmi.supervisor import keep
keep(order)
"""


@contextmanager
def placed(
    components: Mapping[str, Component],
    log: Log,
    isolation: Isolation | None,
    interrupts: Interrupts,
) -> Iterator[dict[str, Instance]]:
    """Instances of components by their names: all in this process, or each in one of its own.

    One more of an FMU that allows one instance a process goes into one of its own in any case.

    Args:
        components: by their names.
        log: takes what the FMUs say.
        isolation: how long isolated FMUs may take; None: all are to be in this process.
        interrupts: that end the wait for an FMU.

    Raises:
        InputError: an FMU cannot be loaded.
        StartError: no process can be started.
        ComponentFailed: an FMU has failed while it was instantiated.

    """
    with ExitStack() as stack:
        apart = {
            name: component
            for name, component in components.items()
            if isolation is not None or not stack.enter_context(_has_room(component))
        }
        here = {name: it for name, it in components.items() if name not in apart}
        instances = stack.enter_context(all_loaded(here, log))
        if apart:
            how = isolation or Isolation()
            for component in apart.values():
                # Here there is time for it, and a caller to tell.
                make_binary(component, component.folder)
            instances |= stack.enter_context(isolated(apart, log, how, interrupts))
        yield {name: instances[name] for name in components}


@contextmanager
def _has_room(component: Component) -> Iterator[bool]:
    """Whether this process may have one more instance, which then counts until the end."""
    if not component.is_once_per_process:
        yield True
        return
    guid = component.description.guid
    with _LOCK:
        has_room = guid not in _taken
        _taken.add(guid)
    try:
        yield has_room
    finally:
        if has_room:
            _taken.remove(guid)


@contextmanager
def isolated(
    components: Mapping[str, Component], log: Log, isolation: Isolation, interrupts: Interrupts
) -> Iterator[dict[str, Instance]]:
    """Instances of components, each in a process of its own; all are gone at the end.

    Args:
        components: by their names.
        log: takes what the FMUs say.
        isolation: how long they may take.
        interrupts: that end the wait for an FMU.

    Raises:
        InputError: an FMU cannot be loaded.
        StartError: no process can be started.
        ComponentFailed: an FMU has failed while it was instantiated.

    """
    with ExitStack() as stack:
        try:
            pairs = [socket.socketpair() for _ in components]
            for pair in pairs:
                for end in pair:
                    stack.enter_context(end)
            supervisor = _Supervisor(components, [there for _, there in pairs])
        except OSError as error:
            raise StartError(f"cannot start processes for FMUs: {reason(error)}") from error
        stack.callback(supervisor.end)
        instances = []
        for number, component in enumerate(components.values()):
            here, there = pairs[number]
            there.close()
            status = partial(supervisor.status, number)
            instances.append(
                IsolatedInstance(component, here, status, log, isolation.step_timeout, interrupts)
            )
        try:
            for instance in instances:
                instance.wait()
            yield {instance.name: instance for instance in instances}
        finally:
            for instance in instances:
                instance.leave()
            for instance in instances:
                instance.farewell()


class _Supervisor:
    """The process that has the FMUs' processes: see :mod:`.supervisor`."""

    def __init__(
        self, components: Mapping[str, Component], connections: Sequence[socket.socket]
    ) -> None:
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
        ready = poll()
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
        self._write(END)
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
