"""Signals to stop, held back while an FMU computes."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from orchestrator.machine.operating_system import is_still, never_wait_for_pipe

#: Signals to stop: from Ctrl-C, a batch system, a closed terminal, and Ctrl-Break on Windows.
_STOPS = [
    getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, n)
]

#: Signals that end a process by default, such as an alarm that an FMU has set.
_ENDS = [
    getattr(signal, n)
    for n in ("SIGALRM", "SIGVTALRM", "SIGPROF", "SIGUSR1", "SIGUSR2", "SIGIO", "SIGXCPU")
    if hasattr(signal, n)
]

#: Number of signals after which the process ends at once.
_INSISTENCE = 3

#: Time after the first signal in which an FMU can return from its step [s]: several signals may
#: come at once, from a key held down or from a batch system, and the machine may be busy.
_PATIENCE = 2.0

#: Exit status of a process that a signal has ended, minus the number of the signal.
_SIGNALLED = 128


class Interrupts:
    """The signals to stop that were received.

    Python raises KeyboardInterrupt wherever it is, which may be inside an FMU: PythonFMU would
    then release its objects twice and crash the process. So signals are collected instead, and
    the loop asks after every step whether there are any.

    Attributes:
        numbers: signal numbers in the order of arrival.
        hand_over: passes the last rows to observers before the process is killed.

    """

    def __init__(self, announce: Callable[[Interrupts], None] | None = None) -> None:
        """Start with none; `announce` is called at once when a signal comes."""
        self.numbers: list[int] = []
        self._announce = announce
        self.hand_over: Callable[[], None] = lambda: None

    def __bool__(self) -> bool:
        """Return True if the work should stop."""
        return bool(self.numbers)

    @property
    def urgent(self) -> bool:
        """True if it should stop quickly: after a second signal, or one not from the keyboard."""
        return len(self.numbers) > 1 or any(number != signal.SIGINT for number in self.numbers)

    def __str__(self) -> str:
        """Return the name of the first signal, if it is not one that a user sends."""
        first = self.numbers[0] if self.numbers else 0
        if first not in _ENDS:
            return ""
        name = signal.Signals(first).name
        return f" by {name}, which an FMU may have caused (--isolate gives it its own process)"

    @contextmanager
    def insistence(self, give_up: Callable[[], None]) -> Iterator[None]:
        """End the process on the third signal within the context, even while an FMU computes.

        It ends two seconds after the first signal at the earliest.

        Args:
            give_up: function that ends the process, called from another thread.

        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        end_of_thread, end_of_signals = os.pipe()
        status = os.fstat(end_of_signals)
        never_wait_for_pipe(end_of_signals)
        before = signal.set_wakeup_fd(end_of_signals, warn_on_full_buffer=False)
        leaving = threading.Lock()
        # A thread, because Python handles no signal while an FMU computes.
        arguments = (end_of_thread, os.fstat(end_of_thread), give_up, leaving)
        with suppress(RuntimeError):
            # If no thread can be started, a third signal does nothing.
            threading.Thread(target=self._count, args=arguments, daemon=True).start()
        try:
            yield
        finally:
            # Wait if `give_up` is being called.
            leaving.acquire()
            signal.set_wakeup_fd(before)
            # An FMU may have closed it, and the number may belong to another file.
            if is_still(end_of_signals, status):
                os.close(end_of_signals)

    def _count(
        self,
        numbers: int,
        status: os.stat_result,
        give_up: Callable[[], None],
        leaving: threading.Lock,
    ) -> None:
        stops: list[float] = []
        with suppress(OSError):
            while number := os.read(numbers, 1):
                if number[0] in _STOPS:
                    stops.append(time.monotonic())
                if len(stops) < _INSISTENCE:
                    continue
                time.sleep(max(0.0, stops[0] + _PATIENCE - time.monotonic()))
                if leaving.acquire(blocking=False):
                    with suppress(Exception):
                        self.hand_over()
                    give_up()
            if is_still(numbers, status):
                os.close(numbers)

    def take(self, number: int, _frame: Any) -> None:
        """Collect a signal: a handler for :func:`signal.signal`."""
        self.numbers.append(number)
        if self._announce is not None:
            self._announce(self)


@contextmanager
def orderly_end(of_process: bool) -> Iterator[None]:
    """Exit normally on SIGTERM and SIGHUP within the context.

    Temporary files are then removed, and child processes end.

    Args:
        of_process: True if the process ends after the context. Signals to stop are then ignored;
            otherwise the former handlers are restored.

    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {n: handler for n in _STOPS if (handler := signal.getsignal(n)) is not None}
    for number, handler in before.items():
        if handler is signal.SIG_DFL:
            signal.signal(number, _leave)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if of_process else handler)


def _leave(number: int, _frame: Any) -> None:
    # A second signal must not interrupt the exit.
    signal.signal(number, signal.SIG_IGN)
    sys.exit(_SIGNALLED + number)


@contextmanager
def held_interrupts(
    announce: Callable[[Interrupts], None] | None = None, *, is_last: bool = False
) -> Iterator[Interrupts]:
    """Collect signals to stop within the context.

    Inside another such context, the outer one collects them. Signals reach the main thread only;
    in other threads nothing is collected.

    Args:
        announce: called at once when a signal comes.
        is_last: True to ignore signals afterwards, until the context of :func:`orderly_end` ends;
            otherwise the former handlers are restored.

    """
    if threading.current_thread() is not threading.main_thread():
        yield Interrupts()
        return
    outer = getattr(signal.getsignal(signal.SIGINT), "__self__", None)
    if isinstance(outer, Interrupts):
        yield outer
        return
    interrupts = Interrupts(announce)
    # Signals that are ignored stay so, for nohup and background jobs.
    heeded = [n for n in _STOPS if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    heeded += [n for n in _ENDS if signal.getsignal(n) is signal.SIG_DFL]
    before = {number: signal.signal(number, interrupts.take) for number in heeded}
    try:
        yield interrupts
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if is_last and number in _STOPS else handler)
