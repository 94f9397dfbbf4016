"""`auv-fmu report` and `table`."""

from __future__ import annotations

import argparse
from pathlib import Path

from orchestrator.commands.options import add_options, add_out
from orchestrator.commands.streams import OK, show
from orchestrator.paper.printed_table import write_table
from orchestrator.paper.report import write_report
from orchestrator.runs.request import Files, Request
from orchestrator.runs.scenario import names
from orchestrator.studies.study import ready_studies


def add_report(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `auv-fmu report`."""
    parser.add_argument(
        "scenarios",
        nargs="*",
        metavar="FILE.toml",
        help="a scenario file to be in the report beside those of `auv-fmu list`",
    )
    parser.add_argument(
        "--studies",
        action="store_true",
        help="hold the printed table against every reading as well, and make the ready studies, "
        "or what is missing of them",
    )
    add_options(parser, Request, "kind")
    add_out(parser, Path("results", "report"))
    add_options(parser, Files, "force")
    parser.set_defaults(action=_report)


def add_table(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `auv-fmu table`."""
    add_out(parser, Path("results", "table"))
    add_options(parser, Files, "force")
    parser.set_defaults(action=_table)


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
