"""`auv-fmu sweep` and `report`: many runs, of a study or for the paper."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from orchestrator.commands.options import add_options, add_out, from_options
from orchestrator.commands.streams import INTERRUPTED, OK, describe, say, show
from orchestrator.paper.report import write_report
from orchestrator.runs.request import Files, Request
from orchestrator.runs.scenario import names
from orchestrator.studies.study import read_study, ready_studies
from orchestrator.studies.sweep import Means, complete_study, study_folder
from orchestrator.vehicle.cautions import CAUTIONS


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu sweep`."""
    describe(
        parser,
        "Run a study and draw its figures. Runs that are already in its folder are not made again.",
        "sweep noise --engine batch",
    )
    ready = ", ".join(ready_studies())
    parser.add_argument(
        "study", metavar="STUDY.toml|NAME", help=f"study file (.toml), or a ready study: {ready}"
    )
    add_options(parser, Means)
    add_out(parser, "results/NAME/")
    parser.set_defaults(action=_sweep)


def add_report(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu report`."""
    describe(
        parser,
        "Run all scenarios, compare them with the paper, and write report.html and report.md.",
        "report --out results/report",
    )
    parser.add_argument(
        "scenarios",
        nargs="*",
        metavar="FILE.toml",
        help="scenario file to add to the scenarios of `auv-fmu list`",
    )
    add_options(parser, Request, "kind")
    add_out(parser, Path("results", "report"))
    add_options(parser, Files, "force")
    parser.set_defaults(action=_report)


def _sweep(options: argparse.Namespace) -> int:
    study = read_study(options.study)
    folder = study_folder(study, options.out)
    try:
        result = complete_study(
            study, from_options(Means, options), folder, options.command, say, progress=True
        )
    except KeyboardInterrupt:
        say(f"interrupted; {folder} keeps the finished runs: the same command continues from there")
        return INTERRUPTED
    show(f"{study.name}: {result.runs:,} runs, of which {result.failed:,} failed")
    for kind, n in result.cautions.items():
        say(f"warning: {n:,} of {result.runs:,} runs: {kind}: {CAUTIONS[kind]}")
    show(f"written to {folder}{os.sep}")
    return OK


def _report(options: argparse.Namespace) -> int:
    # The paper's figures come first, in its order.
    scenarios = sorted(names(), key=lambda name: not name.startswith("fig"))
    scenarios += options.scenarios
    for path in write_report(
        options.out,
        scenarios,
        options.command,
        kind=options.kind,
        force=options.force,
    ):
        show(path)
    return OK
