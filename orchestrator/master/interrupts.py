"""Signals to stop, held back while an FMU computes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

#: Ctrl-C, what a batch system sends, and the end of the terminal.
_STOPS = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]


class Interrupts:
    """The signals to stop that have come.

    Python raises KeyboardInterrupt wherever it is, which may be inside an FMU: PythonFMU would
    then release its objects twice and crash the process. So signals are collected instead, and
    the loop asks after every step whether there are any.
    """

    def __init__(self, announce: Callable[[Interrupts], None] | None = None) -> None:
        """Start with none.

        Args:
            announce: called at once when a signal comes.

        """
        self.signals: list[int] = []
        self._announce = announce

    def __bool__(self) -> bool:
        """Whether somebody wants the work to end."""
        return bool(self.signals)

    @property
    def urgent(self) -> bool:
        """Whether it is to end without what takes long: asked twice, or not from the keyboard."""
        return len(self.signals) > 1 or any(number != signal.SIGINT for number in self.signals)

    def take(self, number: int, _frame: Any) -> None:
        """Collect a signal: a handler for :func:`signal.signal`."""
        self.signals.append(number)
        if self._announce is not None:
            self._announce(self)


@contextmanager
def held_interrupts(
    announce: Callable[[Interrupts], None] | None = None,
) -> Iterator[Interrupts]:
    """Collect signals to stop as long as the context lasts.

    Within another such context the signals are those of the outer one. Signals reach the main
    thread only: elsewhere nothing is held.

    Args:
        announce: called at once when a signal comes.

    """
    if threading.current_thread() is not threading.main_thread():
        yield Interrupts()
        return
    outer = getattr(signal.getsignal(signal.SIGINT), "__self__", None)
    if isinstance(outer, Interrupts):
        yield outer
        return
    interrupts = Interrupts(announce)
    # What is ignored stays so: nohup, or a shell's background.
    heeded = [n for n in _STOPS if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    before = {number: signal.signal(number, interrupts.take) for number in heeded}
    try:
        yield interrupts
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
