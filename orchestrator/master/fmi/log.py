"""What the FMUs of a run have to say."""

from __future__ import annotations

from typing import Any, Protocol

from fmpy.fmi2 import fmi2Discard, fmi2Warning

from orchestrator.machine.errors import shortened

#: Messages that are kept: an FMU may have something to say in every step.
_MOST_MESSAGES = 100

#: Letters of a message on its way from another process.
_LONGEST_LETTER = 10_000


class Listener(Protocol):
    """Something that takes messages."""

    def take(self, status: int, text: str) -> None:
        """Take a message with the status that it was given by FMI, and its component's name."""


class Log:
    """What the FMUs of a run have said with status warning or worse, and what was noticed of them.

    Attributes:
        refusals: the first of it with status discard: a value was not taken, though the call went
            well.

    """

    def __init__(self) -> None:
        """Start empty."""
        self._remarks: list[str] = []
        self._said: list[str] = []
        self._n = 0
        self.refusals: list[str] = []

    def remark(self, text: str) -> None:
        """Note what was noticed of an FMU: no flood of its messages hides that."""
        self._remarks.append(text)

    def take(self, status: int, text: str) -> None:
        """Take a message."""
        if status >= fmi2Warning:
            self._n += 1
            self._said += [text] * (len(self._said) < _MOST_MESSAGES)
        if status == fmi2Discard:
            self.refusals += [text] * (len(self.refusals) < _MOST_MESSAGES)

    @property
    def messages(self) -> tuple[str, ...]:
        """All remarks, the first of what was said, and how much that was."""
        more = self._n - len(self._said)
        return (*self._remarks, *self._said, *([f"and {more} messages more"] * (more > 0)))

    def state(self) -> dict[str, Any]:
        """All of it, as JSON has it."""
        return {
            "remarks": self._remarks,
            "said": self._said,
            "n": self._n,
            "refusals": self.refusals,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take on what another one has taken."""
        self._remarks, self.refusals = state["remarks"], state["refusals"]
        self._said, self._n = state["said"], state["n"]


class MessageQueue:
    """Messages on their way to the log of another process."""

    def __init__(self) -> None:
        """Start empty."""
        self._waiting: list[tuple[int, str]] = []

    def take(self, status: int, text: str) -> None:
        """Take a message; of a flood the log would not keep more than this."""
        if status >= fmi2Warning and len(self._waiting) < _MOST_MESSAGES:
            self._waiting.append((status, shortened(text, _LONGEST_LETTER)))

    def handed_over(self) -> list[tuple[int, str]]:
        """Those that have come since the last call."""
        waiting, self._waiting = self._waiting, []
        return waiting
