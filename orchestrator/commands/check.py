"""`auv-fmu check`: what is wrong with files, without running them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from orchestrator.commands.options import BAD_INPUT, OK, add_variant
from orchestrator.commands.streams import show
from orchestrator.experiments.preparation import Request, loaded, prepare
from orchestrator.experiments.waypoints import impossible_paths
from orchestrator.findings import Findings
from orchestrator.master.binary import check_binary
from orchestrator.master.schedule import delays
from orchestrator.system.examination import examine, surprises

#: How long a run could last that nobody makes [s].
_SOME_TIME = 1.0


def add_to(commands: Any) -> None:
    """Add this command to the parser."""
    check = commands.add_parser(
        "check", help="say all that is wrong with an FMU, an SSP or a scenario"
    )
    check.add_argument(
        "file", metavar="FILE.fmu|FILE.ssp|FILE.toml|SCENARIO", help="what is looked at, not run"
    )
    add_variant(check)
    check.set_defaults(action=_check)


def _check(options: argparse.Namespace) -> int:
    findings = Findings()
    look = _fmu if options.file.endswith(".fmu") else _system
    to_know = look(options, findings)
    for kind, texts in (
        ("problem", findings.problems),
        ("note", findings.notes),
        ("to know", to_know),
    ):
        for text in texts:
            show(f"{kind}: {text}")
    if findings.problems or findings.notes:
        return BAD_INPUT
    show(f"{options.file}: nothing is wrong with it")
    return OK


def _fmu(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Look at an FMU; returns what is to be known of it."""
    component = examine(Path(options.file), findings)
    if component is None:
        return []
    with findings.collecting():
        check_binary(component, component.folder)
    return list(surprises(component))


def _system(options: argparse.Namespace, findings: Findings) -> list[str]:
    """Look at a system as a whole, then at its components; returns what is to be known of it."""
    to_know: list[str] = []
    with findings.collecting():
        scenario, system = loaded(options.file, variant=options.variant, findings=findings)
        for name, component in system.components.items():
            with findings.collecting():
                check_binary(component, component.folder)
            to_know += [f"{name}: {text}" for text in surprises(component)]
        request = Request()
        if scenario.stop_time is None and system.stop_time is None:
            to_know.append("names no stop time: a run wants --stop-time")
            request = Request(stop_time=(system.start_time or 0.0) + _SOME_TIME)
        prepared = prepare(scenario, system, request)
        for text in impossible_paths(prepared.system):
            findings.problem(text)
        to_know += filter(None, [prepared.open_inputs()])
        to_know += delays(prepared.system, prepared.experiment.order)
    return to_know
