"""Messages between this process and the process of an FMU.

A message is a frame of numbers, whose size both sides know, and a note, which is JSON, with bytes
in base64; the first number of the frame is the note's length. In a step there is nothing to note,
so that a message is one write and one read. Numbers and JSON are all that is read: whoever runs an
FMU cannot be made to run anything else by its process.
"""

from __future__ import annotations

import json
import socket
from base64 import b64decode, b64encode
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import Any

import numpy as np

from orchestrator.master.fmi.transfer import FMI_TYPES
from orchestrator.system.component import Component

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
            ValueError, RecursionError, MemoryError: it is no message.

        """
        self._move(self._connection.recv_into, self._received_bytes)
        length = self._received[0]
        if length == 0.0:
            return None
        if not 1.0 <= length <= longest:
            raise ValueError(f"a note of {length:g} bytes, where {longest:,} are the most")
        text = bytearray(int(length))
        self._move(self._connection.recv_into, memoryview(text))
        return json.loads(text, object_hook=_from_text)

    def close(self) -> None:
        """Let the other end know that there is no more."""
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
    inputs, outputs = (
        sum(variable.type in FMI_TYPES for variable in component.having(causality))
        for causality in ("input", "output")
    )
    return inputs, outputs
