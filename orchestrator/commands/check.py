"""`auv-fmu check`: what is wrong with files, without running them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from orchestrator.commands.options import BAD_INPUT, OK
from orchestrator.commands.streams import show
from orchestrator.experiments.preparation import Request, loaded, prepare
from orchestrator.findings import Findings
from orchestrator.master.binary import check_binary
from orchestrator.system.component import Component
from orchestrator.system.examination import examine, surprises
from orchestrator.system.unpacking import unpacked


def add_to(commands: Any) -> None:
    """Add this command to the parser."""
    check = commands.add_parser(
        "check", help="say all that is wrong with an FMU, an SSP or a scenario"
    )
    check.add_argument(
        "file", metavar="FILE.fmu|FILE.ssp|FILE.toml|SCENARIO", help="what is looked at, not run"
    )
    check.add_argument(
        "--variant",
        metavar="NAME",
        help="which description in an SSP: NAME.ssd; default: SystemStructure",
    )
    check.set_defaults(action=_check)


def _check(options: argparse.Namespace) -> int:
    findings = Findings()
    if options.file.endswith(".fmu"):
        component = examine(Path(options.file), findings)
        components = {} if component is None else {component.name: component}
    else:
        components = _components(options, findings)
    for component in components.values():
        with findings.collecting():
            check_binary(component, unpacked(component.fmu))
    for kind, texts in (("problem", findings.problems), ("note", findings.notes)):
        for text in texts:
            show(f"{kind}: {text}")
    for name, component in components.items():
        for text in surprises(component):
            show(f"to know: {name}: {text}")
    if findings.problems or findings.notes:
        return BAD_INPUT
    show(f"{options.file}: nothing is wrong with it")
    return OK


def _components(options: argparse.Namespace, findings: Findings) -> dict[str, Component]:
    """The components of a system, after a look at it as a whole."""
    with findings.collecting():
        scenario, system = loaded(options.file, variant=options.variant, findings=findings)
        with findings.collecting():
            prepare(scenario, system, Request())
        return dict(system.components)
    return {}
