"""The entry point of `auv-fmu`."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from typing import Any

from orchestrator.commands import streams
from orchestrator.commands.streams import say
from orchestrator.machine.children import imported_apart
from orchestrator.machine.errors import reason
from orchestrator.machine.interrupts import orderly_end


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status.

    Args:
        arguments: of a command within a process that goes on; None: the process's own, which
            ends after it.

    """
    # No matrix here is worth a thread, and where one cannot be had numpy's library ends in Ctrl-C.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Where it can keep no fonts it says so at length, and draws all the same.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    streams.fill()
    status = 0
    try:
        with orderly_end(arguments is None), warnings.catch_warnings():
            warnings.showwarning = partial(_warn, warnings.showwarning)
            # What is in the current folder may belong to someone else.
            imported_apart("matplotlib", "matplotlibrc")
            # Half a second of imports, in which Ctrl-C must find an answer, too.
            status = int(import_module("orchestrator.commands.parser").dispatch(arguments))
    except SystemExit as end:
        # The parser has shown its help, or complained.
        if not streams.finished():
            raise SystemExit(end.code or 1) from None
        raise
    except KeyboardInterrupt:
        say("interrupted")
        status = 130
    except (OSError, MemoryError, ImportError) as error:
        # Whatever else this machine does not give.
        say(reason(error))
        status = 2
    return status if streams.finished() else status or 1


def _warn(otherwise: Any, message: Warning | str, category: type[Warning], *place: Any) -> None:
    """Say what is for the user, without the line of the program that it comes from."""
    if category is UserWarning:
        say(f"warning: {message}")
    else:
        otherwise(message, category, *place)


if __name__ == "__main__":
    sys.exit(main())
