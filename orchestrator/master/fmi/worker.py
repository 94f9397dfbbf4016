"""What the process of an isolated FMU does: answer one request after the other."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2OK, fmi2Warning

from orchestrator.machine.errors import InputError, reason
from orchestrator.master.fmi.channel import Channel, sizes
from orchestrator.master.fmi.instance import ComponentFailed, Ended
from orchestrator.master.fmi.loaded import LoadedInstance, loaded
from orchestrator.master.fmi.log import MessageQueue
from orchestrator.master.fmi.surroundings import Surroundings
from orchestrator.master.row import Row
from orchestrator.master.schedule import member, step
from orchestrator.system.component import Component, read_description
from orchestrator.system.structure import System
from orchestrator.system.values import StringTable


@np.errstate(all="ignore")
def serve(name: str, fmu: Path, digest: str, folder: Path, connection: socket.socket) -> None:
    """Say that it begins, instantiate an FMU, and answer requests until there are no more.

    Args:
        name: of the component.
        fmu: the file, for messages.
        digest: of it.
        folder: into which it is unpacked.
        connection: to whom wants it simulated.

    """
    component = Component(name, fmu, read_description(folder).description, digest)
    inputs, outputs = sizes(component)
    # Before the inputs: time and step size.
    channel, messages = Channel(connection, outputs, 2 + inputs), MessageQueue()
    with suppress(EOFError, OSError):
        channel.send()
        try:
            with loaded(component, messages, folder) as instance:
                _Served(component, instance, channel, messages).answer_all()
        except InputError as error:
            channel.send({"refused": str(error)})


class _Served:
    """An instance and whom it answers.

    A request without a call is a step. An answer without a note says that all is well; else the
    note has messages of the FMU, the value that a call has given, or why it has failed.
    Both ends number texts alike: each tells the other those that are new, and has its turn.
    """

    def __init__(
        self,
        component: Component,
        instance: LoadedInstance,
        channel: Channel,
        messages: MessageQueue,
    ) -> None:
        self._instance, self._channel, self._messages = instance, channel, messages
        self._surroundings = Surroundings()
        system = System(component.name, {component.name: component}, ())
        row = Row(system, {component.name: instance})
        self._member = member(instance)
        n = len(channel.incoming) - 2
        self._inputs, self._outputs = row.values[:n], row.values[n:]
        self._strings, self._told = row.strings, len(StringTable())

    def answer_all(self) -> None:
        """Answer until the other end closes, or the FMU must not be called again."""
        going_on = self._answered(lambda: None)
        while going_on:
            request = self._channel.receive() or {}
            for text in request.get("strings", ()):
                self._strings.number(text)
            self._told = len(self._strings)
            self._inputs[:] = self._channel.incoming[2:]
            going_on = self._answered(
                partial(getattr(self._instance, request["call"]), *request["arguments"])
                if "call" in request
                else self._step
            )

    def _step(self) -> None:
        t, h = self._channel.incoming[:2]
        step([self._member], t, h)

    def _are_read(self) -> bool:
        """Whether the outputs can be read after the last step."""
        return all(call() in (fmi2OK, fmi2Warning) for call in self._instance.get_outputs)

    def _answered(self, call: Callable[[], Any]) -> bool:
        note: dict[str, Any] = {}
        try:
            value = call()
            if value is not None:
                note["value"] = value
        except Ended as end:
            note |= {"ended": str(end), "until": end.time if self._are_read() else -inf}
        except ComponentFailed as error:
            note |= {"failed": str(error), "fatal": error.fatal}
        except Exception as error:
            note |= {"failed": f"{self._instance.name}: {reason(error)}", "fatal": True}
        self._surroundings.end_copy()
        if messages := self._messages.handed_over():
            note["messages"] = messages
        if news := self._strings.since(self._told):
            note["strings"] = news
        self._channel.outgoing[:] = self._outputs
        self._channel.send(note or None)
        return not note.get("fatal")
