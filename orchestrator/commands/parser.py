"""The parser of `auv-fmu`, and what the exit status says."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from importlib.metadata import version
from itertools import pairwise

from orchestrator.commands.streams import BAD_INPUT, FAILED, INTERRUPTED, Unheard, say
from orchestrator.machine.errors import InputError, StartError

#: The commands: the module that has `add_COMMAND`, and what they are for.
COMMANDS = {
    "build": ("build", "build every FMU and the bundle auv.ssp, or a component of your own"),
    "list": ("build", "list the scenarios"),
    "gains": ("build", "check the conditions of Theorems 1 and 2"),
    "run": ("run_command", "run a scenario, a scenario file or an SSP"),
    "check": ("check", "say all that is wrong with an FMU, an SSP, a scenario or a study"),
    "sweep": ("sweep_command", "make the runs of a study, or those that are missing"),
    "plot": ("look", "draw any signals of stored results"),
    "view": ("look", "write a page to turn a stored result and play it"),
    "animate": ("look", "write a film of a scenario"),
    "new": ("build", "begin something of your own"),
    "report": ("paper", "run all scenarios and compare with the paper"),
    "table": (
        "paper", "hold the printed table of section 4.2 against all that the paper leaves open"
    ),
    "export": ("exchange", "write a scenario for other tools"),
    "hosts": ("exchange", "run a scenario in other co-simulation tools"),
    "verify": ("exchange", "compare a table from another tool with ours"),
}  # fmt: skip


def dispatch(arguments: Sequence[str] | None) -> int:
    """Run what the arguments say; returns the exit status."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    try:
        options = parser(given).parse_args(given)
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


def parser(given: Iterable[str] = COMMANDS) -> argparse.ArgumentParser:
    """The parser of the command line.

    Args:
        given: arguments; of commands that are not among them only the help is there, as to import
            what a command needs takes up to a second.

    """
    parser = argparse.ArgumentParser(
        prog="auv-fmu",
        description="Co-simulate an autonomous underwater vehicle with limited torque and "
        "without velocity sensors, from FMI 2.0 components.",
        epilog="Exit status: 0; 1 if a simulation failed, with the rows it had kept; 2 for bad "
        "usage or input; 130 if ended by Ctrl-C.",
    )
    parser.add_argument("--version", action="version", version=version("auv-fmu"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    named = set(given)
    for name, (module, text) in COMMANDS.items():
        command = commands.add_parser(name, help=text)
        if name in named:
            getattr(import_module(f"orchestrator.commands.{module}"), f"add_{name}")(command)
    return parser
