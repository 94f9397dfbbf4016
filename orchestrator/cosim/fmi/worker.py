"""What the process of an isolated FMU does, and the messages in which it is asked and answers.

A message is a frame of numbers, whose size both sides know, and a note, which is JSON, with bytes
in base64; the first number of the frame is the note's length. In a step there is nothing to note,
so that a message is one write and one read. Numbers and JSON are all that is read: the process of
an FMU cannot make the other one run anything.
"""

from __future__ import annotations

import json
import socket
from base64 import b64decode, b64encode
from collections.abc import Callable
from contextlib import suppress
from ctypes import c_double
from functools import partial
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2OK, fmi2Warning

from orchestrator.cosim.fmi.instance import ComponentFailed, Ended, MessageQueue
from orchestrator.cosim.fmi.loaded import LoadedInstance, load_instance
from orchestrator.cosim.fmi.surroundings import Surroundings
from orchestrator.cosim.row import Row
from orchestrator.cosim.schedule import member, step_members
from orchestrator.cosim.system.component import Component, read_description
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.values import StringTable
from orchestrator.machine.errors import InputError, reason

#: Bytes beyond which a note is none: of one with the state of an FMU, which may be large, and of
#: any other.
LONGEST_STATE, LONGEST_NOTE = 1 << 30, 1 << 25

#: What stands for bytes in a note: an object with only this key, which is no variable's name.
_BYTES = "\0base64"


class Channel:
    """One end of a connection.

    Attributes:
        outgoing, incoming: the numbers of the next message, and of the last one.

    """

    def __init__(
        self,
        connection: socket.socket,
        outgoing: int,
        incoming: int,
        waited: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Use a connected socket.

        Args:
            connection: whose timeout, if it has one, says how often `waited` is called.
            outgoing, incoming: how many numbers go with each message.
            waited: called with the seconds for which a message is waited for, to raise something.

        """
        self._connection = connection
        self._waited = waited
        self._sent, self._received = np.zeros(1 + outgoing), np.zeros(1 + incoming)
        self._sent_bytes = self._sent.data.cast("B")
        self._received_bytes = self._received.data.cast("B")
        self.outgoing, self.incoming = self._sent[1:], self._received[1:]

    def send(self, note: Any = None) -> None:
        """Send a message.

        Raises:
            OSError: the other end is closed.

        """
        written = "" if note is None else json.dumps(note, default=_as_text, ensure_ascii=False)
        text = written.encode(errors="replace")
        self._sent[0] = len(text)
        self._move(self._connection.send, self._sent_bytes)
        if text:
            self._move(self._connection.send, memoryview(text))

    def receive(self, longest: int = LONGEST_STATE) -> Any:
        """Receive a message, and return its note, or None.

        Args:
            longest: note that may come [bytes].

        Raises:
            EOFError, OSError: the other end is closed.
            ValueError, RecursionError, MemoryError: it is not a message.

        """
        self._move(self._connection.recv_into, self._received_bytes)
        length = self._received[0]
        if length == 0.0:
            return None
        if not 1.0 <= length <= longest:
            raise ValueError(f"a message of {length:g} bytes, more than {longest:,}")
        text = bytearray(int(length))
        self._move(self._connection.recv_into, memoryview(text))
        return json.loads(text, object_hook=_from_text)

    def close(self) -> None:
        """Tell the other end that nothing more follows."""
        self._connection.close()

    def _move(self, move: Callable[[memoryview], int], data: memoryview) -> None:
        """Send or receive all of some bytes."""
        begun = monotonic()
        while True:
            with suppress(TimeoutError):
                n = move(data)
                if n == len(data):
                    return
                if n == 0:
                    raise EOFError
                data = data[n:]
            self._waited(monotonic() - begun)


def _as_text(value: bytes) -> dict[str, str]:
    return {_BYTES: b64encode(value).decode("ascii")}


def _from_text(read: dict[str, Any]) -> Any:
    return b64decode(read[_BYTES], validate=True) if read.keys() == {_BYTES} else read


def sizes(component: Component) -> tuple[int, int]:
    """How many inputs and outputs a component has in a row."""
    return len(component.having("input")), len(component.having("output"))


@np.errstate(all="ignore")
def serve(name: str, fmu: Path, digest: str, folder: Path, connection: socket.socket) -> None:
    """Say that it begins, instantiate an FMU, and answer requests until there are no more.

    Args:
        name: of the component.
        fmu: the file, for messages.
        digest: of it.
        folder: into which it is unpacked.
        connection: to the process that simulates it.

    """
    component = Component(name, fmu, read_description(folder).description, digest)
    inputs, outputs = sizes(component)
    # Before the inputs: time and step size.
    channel, messages = Channel(connection, outputs, 2 + inputs), MessageQueue()
    with suppress(EOFError, OSError):
        channel.send()
        try:
            with load_instance(component, messages, folder) as instance:
                _Served(component, instance, channel, messages).answer_all()
        except InputError as error:
            channel.send({"refused": str(error)})


class _Served:
    """An instance, and the channel on which it answers requests.

    A request without a call is a step; in one of no length, values are exchanged only. An answer
    without a note says that all is well; else the note has messages of the FMU, the value that a
    call has given, or why it has failed.
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
        if h:
            step_members([self._member], c_double(t), c_double(h))
        else:
            self._instance.exchange()

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
