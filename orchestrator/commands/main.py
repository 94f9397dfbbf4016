"""The entry point of `auv-fmu`."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module

from orchestrator.commands import streams


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    streams.fill()
    try:
        with _interrupts_end_the_process():
            # Half a second of imports.
            dispatch: Callable[[Sequence[str] | None], int]
            dispatch = import_module("orchestrator.commands.parser").dispatch
        status = dispatch(arguments)
    except SystemExit as end:
        # The parser has shown its help, or complained.
        if not streams.finished():
            raise SystemExit(end.code or 1) from None
        raise
    return status if streams.finished() else status or 1


@contextmanager
def _interrupts_end_the_process() -> Iterator[None]:
    """Let Ctrl-C end a process that has not begun with anything, however deep it is in imports."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        # Ignored, or somebody else's.
        yield
        return
    try:
        signal.signal(signal.SIGINT, _leave)
    except ValueError:
        # In a thread that gets no signals.
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _leave(*_: object) -> None:
    streams.say("interrupted")
    os._exit(130)


if __name__ == "__main__":
    sys.exit(main())
