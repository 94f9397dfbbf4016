"""`auv-fmu sweep`."""

from __future__ import annotations

import argparse
import os

from orchestrator.commands.options import add_options, add_out, taken
from orchestrator.commands.streams import INTERRUPTED, OK, say, show
from orchestrator.studies.study import ready_studies
from orchestrator.studies.study_file import read_study
from orchestrator.studies.sweep import Means, folder_of, swept


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `auv-fmu sweep`."""
    ready = ", ".join(ready_studies())
    parser.add_argument(
        "study", metavar="STUDY.toml|NAME", help=f"a study file, or a ready study: {ready}"
    )
    add_options(parser, Means)
    add_out(parser, None, "results/NAME/")
    parser.set_defaults(action=_sweep)


def _sweep(options: argparse.Namespace) -> int:
    study = read_study(options.study)
    folder = folder_of(study, options.out)
    try:
        result = swept(study, taken(Means, options), folder, options.command, say, progress=True)
    except KeyboardInterrupt:
        say(f"interrupted; {folder} keeps what is done: the same command goes on from there")
        return INTERRUPTED
    show(f"{study.name}: {result.runs:,} runs, of which {result.failed:,} failed")
    show(f"written to {folder}{os.sep}")
    return OK
