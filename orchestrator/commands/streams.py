"""Output of the command line, and its exit statuses; streams may be closed or full."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from typing import TextIO

from orchestrator.machine.errors import escape_unprintable, shortened

#: Exit status: done, a simulation failed, bad usage or input, ended by the user.
OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

#: Longest line for the user: a name or a value in it may be a whole file.
_LONGEST = 4000


class OutputLost(Exception):
    """Standard output cannot be written; the user has been told."""


def fill_streams() -> None:
    """Open the null device in place of closed standard streams.

    Otherwise, the next file that is opened would get their number, and the output.

    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


def say(text: str) -> None:
    """Write a line for the user to standard error, above progress bars."""
    with suppress(OSError), _above_bars(sys.stderr):
        print(
            shortened(f"auv-fmu: {escape_unprintable(text)}", _LONGEST), file=sys.stderr, flush=True
        )


class _Log(logging.Handler):
    """Shows the lines of the program's log."""

    def emit(self, record: logging.LogRecord) -> None:
        """Show one."""
        say(record.getMessage())


@contextmanager
def shown_log() -> Iterator[None]:
    """Show what the program logs within the context."""
    log, handler = logging.getLogger("auv_fmu"), _Log()
    if log.level == logging.NOTSET:
        log.setLevel(logging.INFO)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


def show(*lines: object) -> None:
    """Write lines of output.

    Raises:
        OutputLost: they cannot be written.

    """
    try:
        with _above_bars(sys.stdout):
            for line in lines:
                print(_encodable(sys.stdout, escape_unprintable(str(line))))
    except OSError as error:
        _give_up(sys.stdout, error)
        raise OutputLost from error


def _above_bars(stream: TextIO) -> AbstractContextManager[object]:
    """Move progress bars out of the way of a stream."""
    bars = sys.modules.get("tqdm")
    mode: AbstractContextManager[object] = (
        bars.tqdm.external_write_mode(stream) if bars else nullcontext()
    )
    return mode


def _encodable(stream: TextIO, text: str) -> str:
    """Escape letters that a stream cannot write, such as many in Windows' code pages."""
    encoding = stream.encoding or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)


def finished() -> bool:
    """Flush all output; returns False, after a message, if it cannot be written."""
    return all([_flushed(sys.stdout), _flushed(sys.stderr)])


def _flushed(stream: TextIO) -> bool:
    try:
        stream.flush()
    except OSError as error:
        _give_up(stream, error)
        return False
    return True


def _give_up(stream: TextIO, error: OSError) -> None:
    # Otherwise, Python tries again when the process ends, and prints a traceback.
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    # A reader that has ended needs no message.
    if not isinstance(error, BrokenPipeError):
        say(f"cannot write the output: {error.strerror}")


def describe(parser: argparse.ArgumentParser, text: str, example: str) -> None:
    """Set the description of a command, and an example below its options."""
    parser.description, parser.epilog = text, f"Example: auv-fmu {example}"
