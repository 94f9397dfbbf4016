"""The entry point of `auv-fmu`; it imports only the modules of the named command."""

from __future__ import annotations

import argparse
import logging
import os
import re
import sys
import textwrap
import warnings
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from importlib import import_module
from itertools import pairwise
from typing import Any, NoReturn

from auv_fmu import __version__
from orchestrator.commands import streams
from orchestrator.commands.streams import BAD_INPUT, FAILED, INTERRUPTED, OK, OutputLost, say
from orchestrator.machine.children import imported_apart
from orchestrator.machine.errors import InputError, StartError, did_you_mean, reason
from orchestrator.machine.interrupts import orderly_end
from orchestrator.machine.lazy import passing_line
from orchestrator.runs import SCENARIOS_FOLDER, names_in

#: The commands by subject: the module with `add_COMMAND`, and the purpose.
_GROUPS = {
    "run and look": {
        "list": ("listing", "list the scenarios"),
        "run": ("run_command", "run a scenario, an SSP or an FMU"),
        "plot": ("look", "plot signals of stored results"),
        "view": ("look", "write a page that plays a stored result in 3D"),
        "live": ("look", "write an interactive page: move sliders, watch the loop"),
        "animate": ("look", "write a film of a scenario"),
        "sweep": ("many_runs", "run a study: many runs with varied parameters"),
        "benchmark": ("benchmark", "compare control laws in a table, also your own"),
    },
    "your own components": {
        "new": ("build", "create a component or a controller from a template"),
        "build": ("build", "build the FMU of your component, or all bundled FMUs"),
        "check": ("check", "find mistakes in a component, scenario, study, FMU or SSP"),
    },
    "other tools": {
        "export": ("exchange", "write a scenario for other tools"),
        "hosts": ("exchange", "run a scenario in other co-simulation tools"),
        "verify": ("exchange", "compare another tool's table, or an FMU's own, with a run"),
        "release": ("exchange", "write the archives of a release"),
    },
    "the paper": {
        "gains": ("build", "check the conditions of Theorems 1 and 2"),
        "report": ("many_runs", "run all scenarios and compare them with the paper"),
    },
}
COMMANDS = {name: what for group in _GROUPS.values() for name, what in group.items()}

#: Commands that are quick, or show their progress themselves.
_SHOWN = {"benchmark", "hosts", "list", "report", "run", "sweep"}

#: Columns of the help.
_NAMES, _WIDTH = 10, 78


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status.

    Args:
        arguments: of a command in a process that continues; None: the arguments of the process,
            which ends after it.

    """
    # Matrices here are small, and numpy's library ends the process if it cannot start a thread.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Without a folder for its fonts, it draws, too, but with long warnings.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    streams.fill_streams()
    status = OK
    try:
        with orderly_end(arguments is None), warnings.catch_warnings(), streams.shown_log():
            warnings.showwarning = partial(_warn, warnings.showwarning)
            # A file in the current folder may belong to someone else.
            imported_apart("matplotlib", "matplotlibrc")
            given = sys.argv[1:] if arguments is None else list(arguments)
            options = parser(given).parse_args(given)
            _check_no_empty(given)
            options.command = ["auv-fmu", *given]
            with _working(given):
                status = int(options.action(options))
    except InputError as error:
        say(str(error))
        status = FAILED if isinstance(error, StartError) else BAD_INPUT
    except OutputLost:
        status = FAILED
    except SystemExit as end:
        # The parser has shown its help, or a mistake.
        if not streams.finished():
            raise SystemExit(end.code or FAILED) from None
        raise
    except KeyboardInterrupt:
        say("interrupted")
        status = INTERRUPTED
    except (OSError, MemoryError, ImportError) as error:
        # Limits of this machine.
        say(reason(error))
        status = BAD_INPUT
    return status if streams.finished() else status or FAILED


def _working(arguments: Sequence[str]) -> AbstractContextManager[object]:
    """Show the command on a terminal while it works, unless it is quick or shows progress."""
    if not sys.stderr.isatty() or arguments[0] in _SHOWN:
        return nullcontext()
    context: AbstractContextManager[object] = passing_line(f"auv-fmu {arguments[0]} ...")
    return context


def _warn(otherwise: Any, message: Warning | str, category: type[Warning], *place: Any) -> None:
    """Show a warning for the user, without the line of code that it comes from."""
    if category is UserWarning:
        say(f"warning: {message}")
    else:
        otherwise(message, category, *place)


def _check_no_empty(arguments: Sequence[str]) -> None:
    """Check that no argument is empty, like an unset variable of the shell.

    Raises:
        InputError: one is empty.

    """
    for before, argument in pairwise(("auv-fmu", *arguments)):
        if not argument:
            raise InputError(f"the argument after {before} is empty")
        if re.fullmatch(r"--[\w-]+=", argument):
            raise InputError(f"{argument} has no value")


class Parser(argparse.ArgumentParser):
    """A parser that reports a mistake in two lines: a short usage, and the mistake."""

    def parse_known_args(self, *arguments: Any, **more: Any) -> tuple[Any, list[str]]:
        """Parse arguments; the parser of a command refuses unknown ones, with its own usage."""
        options, unknown = super().parse_known_args(*arguments, **more)
        if unknown:
            names = (word.partition("=")[0] for word in unknown if word.startswith("-"))
            hints = (did_you_mean(name, self._option_string_actions) for name in names)
            hint = next(filter(None, hints), "")
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return options, unknown

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = [*map(str, action.choices)]
            hint = did_you_mean(str(value), names) or f"; choose from {', '.join(names)}"
            if value in names_in(SCENARIOS_FOLDER) and "run" in names:
                hint = f"; did you mean auv-fmu run {value}?"
            if isinstance(action, argparse._SubParsersAction):
                raise argparse.ArgumentError(
                    None, f"no {str(action.metavar).lower()} {value!r}{hint}"
                )
            raise argparse.ArgumentError(action, f"invalid choice: {value!r}{hint}")

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        try:
            return super()._get_value(action, text)
        except argparse.ArgumentError:
            if action.type not in (float, int):
                raise
            what = "a number" if action.type is float else "a whole number"
            raise argparse.ArgumentError(action, f"{text!r} is not {what}") from None

    def error(self, message: str) -> NoReturn:
        """Print the mistake, and end the process."""
        words = []
        for action in self._get_positional_actions():
            many = "" if action.nargs in (None, argparse.OPTIONAL) else " ..."
            is_needed = action.nargs not in (argparse.OPTIONAL, argparse.ZERO_OR_MORE)
            word = f"{action.metavar or action.dest}{many}"
            words.append(word if is_needed else f"[{word}]")
        usage = " ".join([f"usage: {self.prog} [OPTIONS]", *words])
        self.exit(BAD_INPUT, f"{usage} (--help lists the options)\n{self.prog}: error: {message}\n")


def parser(given: Iterable[str] = COMMANDS) -> argparse.ArgumentParser:
    """Make the parser of the command line.

    Args:
        given: arguments; other commands have only their help, because importing the modules of a
            command takes up to a second.

    """
    groups = (
        "\n".join([f"{title}:", *(f"  {name:{_NAMES}}{text}" for name, (_, text) in group.items())])
        for title, group in _GROUPS.items()
    )
    purpose = (
        "Co-simulate an autonomous underwater vehicle with limited torque and without velocity "
        "sensors, from FMI components."
    )
    ends = (
        "`auv-fmu COMMAND --help` shows the options of a command and an example. Exit status: 0 on "
        "success; 1 if a simulation failed (its rows are kept); 2 for bad usage or input; 130 "
        "after Ctrl-C."
    )
    parser = Parser(
        prog="auv-fmu",
        usage="auv-fmu [-h] [--version] COMMAND ...",
        description="\n\n".join([textwrap.fill(purpose, _WIDTH), *groups]),
        epilog=textwrap.fill(ends, _WIDTH),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=__version__)
    # The groups above list them.
    commands = parser.add_subparsers(
        required=True, prog="auv-fmu", metavar="COMMAND", help=argparse.SUPPRESS
    )
    named = set(given)
    for name, (module, _) in COMMANDS.items():
        command = commands.add_parser(name)
        if name in named:
            getattr(import_module(f"orchestrator.commands.{module}"), f"add_{name}")(command)
    return parser
