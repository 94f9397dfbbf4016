"""In which process each FMU runs: in this one, or in one that a supervisor starts for it."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from threading import Lock

from orchestrator.cosim.fmi.binary import make_binary
from orchestrator.cosim.fmi.instance import Instance, Log
from orchestrator.cosim.fmi.isolated import IsolatedInstance, Isolation
from orchestrator.cosim.fmi.loaded import load_instance
from orchestrator.cosim.fmi.supervisor import Supervisor
from orchestrator.cosim.system.component import Component
from orchestrator.machine.errors import InputError, StartError, reason
from orchestrator.machine.interrupts import Interrupts
from orchestrator.machine.operating_system import can_isolate

#: FMUs that allow one instance a process, and have it in this one, for runs in several threads.
_taken: set[str] = set()
_LOCK = Lock()


@contextmanager
def place_instances(
    components: Mapping[str, Component],
    log: Log,
    isolation: Isolation | None,
    interrupts: Interrupts,
) -> Iterator[dict[str, Instance]]:
    """Place instances of components, by name: all in this process, or each in a separate one.

    A further instance of an FMU that allows one per process always gets a separate process.

    Args:
        components: by their names.
        log: takes what the FMUs say.
        isolation: how long isolated FMUs may take; None: all are in this process.
        interrupts: that end the wait for an FMU.

    Raises:
        InputError: an FMU cannot be loaded.
        StartError: no process can be started.
        ComponentFailed: an FMU has failed while it was instantiated.

    """
    with ExitStack() as stack:
        apart: dict[str, Component] = {}
        instances: dict[str, Instance] = {}
        for name, component in components.items():
            if isolation is None and stack.enter_context(_has_room(component)):
                instances[name] = stack.enter_context(load_instance(component, log))
            else:
                apart[name] = component
                # Here there is time for it, and a caller to tell.
                make_binary(component, component.folder)
        if apart:
            how = isolation or Isolation()
            instances |= stack.enter_context(isolate_instances(apart, log, how, interrupts))
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
def isolate_instances(
    components: Mapping[str, Component], log: Log, isolation: Isolation, interrupts: Interrupts
) -> Iterator[dict[str, Instance]]:
    """Place instances, each in a separate process; all end with it.

    Raises:
        InputError: this system has no such processes.
        StartError: no process can be started.

    """
    if not can_isolate():
        raise InputError(
            f"{', '.join(components)}: FMUs cannot be run in separate processes on Windows: leave "
            "out --isolate, and use an FMU that allows one instance per process only once"
        )
    with ExitStack() as stack:
        try:
            pairs = [socket.socketpair() for _ in components]
            for pair in pairs:
                for end in pair:
                    stack.enter_context(end)
            supervisor = Supervisor(components, [there for _, there in pairs])
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
