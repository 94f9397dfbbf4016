"""Options that several commands share, and messages about the end of a run."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from fmus.kinds import AUTO, FMI_VERSIONS, KINDS, NATIVE, PYTHON
from orchestrator.commands.streams import FAILED, OK, say
from orchestrator.cosim import Ending, System
from orchestrator.machine.errors import Findings, InputError
from orchestrator.runs.bundle import best_kind
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.request import Request, flags
from orchestrator.runs.scenario import Scenario

T = TypeVar("T")


def add_system(parser: argparse.ArgumentParser) -> None:
    """Add the system to run."""
    parser.add_argument(
        "scenario",
        metavar="SCENARIO|FILE|DIR",
        help="scenario from `auv-fmu list`, scenario file (.toml), SSP archive (.ssp) or unpacked "
        "SSP folder, FMU, or OspSystemStructure.xml of libcosim",
    )
    add_variant(parser)


def add_variant(parser: argparse.ArgumentParser) -> None:
    """Add the choice of a system in an archive."""
    parser.add_argument(
        "--variant",
        metavar="NAME",
        help="system description to use in an SSP, NAME.ssd; default: SystemStructure",
    )


def add_options(parser: argparse.ArgumentParser, declared: type[Any], *names: str) -> None:
    """Add the fields of a dataclass that are options: the named ones, or all."""
    for name, flag, how in flags(declared):
        if not names or name in names:
            parser.add_argument(flag, **how)


def from_options(declared: type[T], options: argparse.Namespace) -> T:
    """Make a dataclass from the options that are its fields; other fields keep their defaults."""
    given = vars(options)
    return declared(**{name: given[name] for name, *_ in flags(declared) if name in given})


def request(options: argparse.Namespace) -> Request:
    """Make a request from the options."""
    return replace(from_options(Request, options), parameters=assignments(options))


def add_fmi(parser: argparse.ArgumentParser, *others: str) -> None:
    """Add the version of FMI; `others` are further options that allow the last one."""
    needs = " or ".join((f"--kind {NATIVE}", *others))
    parser.add_argument(
        "--fmi",
        choices=FMI_VERSIONS,
        default=FMI_VERSIONS[0],
        help=f"FMI version of the FMUs; 3 needs {needs}; default: {FMI_VERSIONS[0]}",
    )


def add_platforms(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the platforms of libraries; `what` is the option that makes libraries."""
    parser.add_argument(
        "--platforms",
        metavar="NAME,...|all",
        help=f"platforms to compile for with {what}, by their FMI names, or all; those other than "
        "this machine's need auv-fmu[native]; default: this machine",
    )


def add_kind(parser: argparse.ArgumentParser) -> None:
    """Add the kind of FMUs for other tools; the default does not depend on a compiler here."""
    parser.add_argument(
        "--kind",
        type=_kind,
        choices=(AUTO, *KINDS),
        default=PYTHON,
        help=f"kind of FMUs for other tools: {PYTHON} (source code) or {NATIVE} (its translation "
        f"to C), with the same numbers, or {AUTO} ({NATIVE} if there is a C compiler); default: "
        f"{PYTHON}",
    )


def _kind(text: str) -> str:
    """Return the kind that a user has named; for `auto`, the one that can be built here."""
    return best_kind() if text == AUTO else text


def add_set(parser: argparse.ArgumentParser) -> None:
    """Add values that replace the scenario's."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="COMPONENT.PARAMETER=VALUE",
        help="set a parameter, for example plant.noise.std=0; may be repeated",
    )


def add_out(parser: argparse.ArgumentParser, default: Path | str) -> None:
    """Add the output folder; its default is a path, or a text for the help only."""
    path = default if isinstance(default, Path) else None
    text = f"output folder; default: {default}"
    parser.add_argument("--out", type=Path, default=path, metavar="DIR", help=text)


def read_system(
    options: argparse.Namespace,
    kind: str | None = None,
    fmi: str = FMI_VERSIONS[0],
    platforms: str | None = None,
) -> tuple[Scenario, System]:
    """Read the scenario and system to run; harmless flaws become warnings."""
    findings = Findings(options.strict)
    kind = options.kind if kind is None else kind
    scenario, system = load_scenario(
        options.scenario, kind, fmi, options.variant, findings, platforms
    )
    findings.refuse()
    for note in findings.notes:
        say(f"warning: {note}")
    return scenario, system


def status(name: str, ending: Ending) -> int:
    """Show the events and the end of a run, and return its exit status."""
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


def assignments(options: argparse.Namespace) -> dict[str, object]:
    """Return the values of --set."""
    values: dict[str, object] = {}
    for text in options.set:
        name, equals, value = map(str.strip, text.partition("="))
        if not equals:
            raise InputError(f"--set {text}: write COMPONENT.PARAMETER=VALUE")
        # The last assignment wins, also over a group before it.
        values.pop(name, None)
        values[name] = value
    return values
