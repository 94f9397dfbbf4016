"""`auv-fmu report` and `table`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from orchestrator.commands.options import OK, add_force, add_kind, add_out
from orchestrator.commands.streams import show
from orchestrator.paper.printed_table import write_table
from orchestrator.paper.report import write_report
from orchestrator.runs.scenario import names
from orchestrator.studies.study import ready_studies


def add_to(commands: Any) -> None:
    """Add these commands to the parser."""
    report = commands.add_parser("report", help="run all scenarios and compare with the paper")
    report.add_argument(
        "scenarios",
        nargs="*",
        metavar="FILE.toml",
        help="a scenario file to be in the report beside those of `auv-fmu list`",
    )
    report.add_argument(
        "--studies",
        action="store_true",
        help="hold the printed table against every reading as well, and make the ready studies, "
        "or what is missing of them",
    )
    add_kind(report)
    add_out(report, Path("results", "report"))
    add_force(report)
    report.set_defaults(action=_report)

    table = commands.add_parser(
        "table", help="hold the printed table of section 4.2 against all that the paper leaves open"
    )
    add_out(table, Path("results", "table"))
    add_force(table)
    table.set_defaults(action=_table)


def _report(options: argparse.Namespace) -> int:
    scenarios = [*names(), *options.scenarios]
    ready = ready_studies() if options.studies else ()
    for path in write_report(
        options.out,
        scenarios,
        options.command,
        kind=options.kind,
        ready=ready,
        variants=options.studies,
        force=options.force,
    ):
        show(path)
    return OK


def _table(options: argparse.Namespace) -> int:
    for path in write_table(options.out, options.command, options.force):
        show(path)
    return OK
