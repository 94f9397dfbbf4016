"""Options that several commands have, and what they say."""

from __future__ import annotations

import argparse
from pathlib import Path

from orchestrator.commands.streams import FAILED, OK, say
from orchestrator.machine.errors import Findings, InputError
from orchestrator.master.experiment import ORDERS, order_of
from orchestrator.master.loop import LOOPS
from orchestrator.master.observers.observer import Ending
from orchestrator.runs.bundle import FMI, KINDS, NATIVE, PYTHON
from orchestrator.runs.preparation import Request, loaded
from orchestrator.runs.scenario import Scenario
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System


def add_system(parser: argparse.ArgumentParser) -> None:
    """What is run."""
    parser.add_argument(
        "scenario",
        metavar="SCENARIO|FILE|DIR",
        help="a scenario of `auv-fmu list`, a scenario file, an SSP or the folder of one that is "
        "unpacked, an FMU, or libcosim's OspSystemStructure.xml",
    )
    add_variant(parser)
    parser.add_argument(
        "--strict",
        action="store_true",
        help="refuse what otherwise is a warning",
    )


def add_variant(parser: argparse.ArgumentParser) -> None:
    """Which system of an archive."""
    parser.add_argument(
        "--variant",
        metavar="NAME",
        help="which description in an SSP: NAME.ssd; default: SystemStructure",
    )


def add_experiment(parser: argparse.ArgumentParser) -> None:
    """How long it is run, and how."""
    parser.add_argument(
        "--stop-time", type=float, metavar="S", help="end of the run [s]; default: the scenario's"
    )
    parser.add_argument(
        "--step",
        type=float,
        metavar="S",
        help="communication step [s]; default: the scenario's, else 0.02",
    )
    add_order(parser, f"the scenario's, else {ORDERS[0]}")
    add_kind(parser)


def add_order(parser: argparse.ArgumentParser, default: str) -> None:
    """Who is stepped when."""
    parser.add_argument(
        "--order",
        type=order_of,
        metavar=f"{'|'.join(ORDERS)}|NAME,...",
        help="order in which the components are stepped, or the names of all of them; default: "
        + default,
    )


def add_kind(parser: argparse.ArgumentParser) -> None:
    """Which FMUs of the bundle."""
    parser.add_argument(
        "--kind",
        choices=KINDS,
        default=PYTHON,
        help="of the bundle's FMUs: Python sources, or their translation to C, with the same "
        f"numbers; default: {PYTHON}",
    )


def add_loop(parser: argparse.ArgumentParser) -> None:
    """What makes the steps."""
    parser.add_argument(
        "--loop",
        choices=LOOPS,
        default=LOOPS[0],
        help="what makes the steps: Python, or a loop in C; the rows are the same; default: auto, "
        "the compiled one where it is to be had",
    )


def add_fmi(parser: argparse.ArgumentParser) -> None:
    """Which version of FMI."""
    parser.add_argument(
        "--fmi",
        choices=FMI,
        default=FMI[0],
        help=f"version of the FMUs; 3 needs --kind {NATIVE}; default: {FMI[0]}",
    )


def add_set(parser: argparse.ArgumentParser) -> None:
    """Values that win over the scenario's."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="COMPONENT.PARAMETER=VALUE",
        help="change a parameter, for example plant.noise.std=0; may be repeated",
    )


def add_out(parser: argparse.ArgumentParser, default: Path | None, otherwise: str = "") -> None:
    """Where the files go."""
    parser.add_argument(
        "--out",
        type=Path,
        default=default,
        metavar="DIR",
        help=f"folder to write into; default: {default or otherwise}",
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    """What becomes of files of the user's that are in the way."""
    parser.add_argument(
        "--force",
        action="store_true",
        help="move files of yours aside that have names of files that are written, to NAME.~1~; "
        "otherwise they stay, and nothing is written",
    )


def read(options: argparse.Namespace, fmi: str = FMI[0]) -> tuple[Scenario, System]:
    """What is run; what is not as it should be, and does no harm, becomes a warning."""
    findings = Findings(options.strict)
    found = loaded(options.scenario, options.kind, fmi, options.variant, findings)
    for note in findings.notes:
        say(f"warning: {note}")
    return found


def request(options: argparse.Namespace) -> Request:
    """What the user asks for beyond the scenario."""
    return Request(
        options.stop_time,
        options.step,
        options.order,
        assignments(options),
        kind=options.kind,
        strict=options.strict,
    )


def status(name: str, ending: Ending) -> int:
    """Exit status of a run, after saying what has happened, and what went wrong in it."""
    failure = ending.failure or ""
    for message in ending.messages:
        if not failure.endswith(f": {message}"):
            say(message)
    for occurrence in ending.events:
        say(f"{name}: {occurrence}")
    if ending.remark is not None:
        say(f"{name} {ending.remark}")
    if ending.failure is None:
        return OK
    say(f"{name} {ending.failure}")
    return FAILED


def assignments(options: argparse.Namespace) -> dict[PortName, object]:
    """The values of --set."""
    return dict(map(_assignment, options.set))


def _assignment(text: str) -> tuple[PortName, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise InputError(f"--set {text}: write COMPONENT.PARAMETER=VALUE")
    return port_name(name.strip()), value.strip()
