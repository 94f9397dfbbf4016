"""The parser of `auv-fmu`, and what the exit status says."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from importlib.metadata import version
from itertools import pairwise

from orchestrator.commands import build, check, exchange, look, paper, run_and_sweep
from orchestrator.commands.options import BAD_INPUT, FAILED, INTERRUPTED
from orchestrator.commands.streams import Unheard, say
from orchestrator.machine.errors import InputError, StartError


def dispatch(arguments: Sequence[str] | None) -> int:
    """Run what the arguments say; returns the exit status."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    try:
        options = parser().parse_args(given)
        _check_no_empty(given)
        options.command = ["auv-fmu", *given]
        return int(options.action(options))
    except InputError as error:
        say(str(error))
        return FAILED if isinstance(error, StartError) else BAD_INPUT
    except KeyboardInterrupt:
        say("interrupted")
        return INTERRUPTED
    except Unheard:
        return FAILED


def _check_no_empty(arguments: Sequence[str]) -> None:
    """Check that all arguments say something: a variable of the shell may be unset.

    Raises:
        InputError: one is empty.

    """
    for before, argument in pairwise(("auv-fmu", *arguments)):
        if not argument:
            raise InputError(f"the argument after {before} is empty")
        if re.fullmatch(r"--[\w-]+=", argument):
            raise InputError(f"{argument} says nothing")


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="auv-fmu",
        description="Co-simulate an autonomous underwater vehicle with limited torque and "
        "without velocity sensors, from FMI 2.0 components.",
        epilog="Exit status: 0; 1 if a simulation failed, with the rows it had kept; 2 for bad "
        "usage or input; 130 if ended by Ctrl-C.",
    )
    parser.add_argument("--version", action="version", version=version("auv-fmu"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for group in (build, run_and_sweep, check, look, paper, exchange):
        group.add_to(commands)
    return parser
