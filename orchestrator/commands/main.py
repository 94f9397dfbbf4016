"""The entry point of `auv-fmu`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    try:
        # Half a second of imports, in which Ctrl-C must find an answer, too.
        return int(import_module("orchestrator.commands.parser").dispatch(arguments))
    except KeyboardInterrupt:
        print("auv-fmu: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
