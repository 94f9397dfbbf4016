"""`auv-fmu sweep`."""

from __future__ import annotations

import argparse
import os
from typing import Any

from orchestrator.commands.options import INTERRUPTED, OK, add_force, add_kind, add_loop, add_out
from orchestrator.commands.streams import say, show
from orchestrator.studies.study import ENGINES, read_study, ready_studies
from orchestrator.studies.sweep import Means, folder_of, swept


def add_to(commands: Any) -> None:
    """Add this command to the parser."""
    sweep = commands.add_parser("sweep", help="make the runs of a study, or those that are missing")
    ready = ", ".join(ready_studies())
    sweep.add_argument(
        "study", metavar="STUDY.toml|NAME", help=f"a study file, or a ready study: {ready}"
    )
    sweep.add_argument(
        "--engine",
        choices=ENGINES,
        help="that makes the runs: the FMUs, or the compiled equations, with the same numbers; "
        "default: the study's own",
    )
    add_kind(sweep)
    add_loop(sweep)
    sweep.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a Dask scheduler whose workers make the runs, for example tcp://10.0.0.1:8786; "
        "default: processes on this machine",
    )
    sweep.add_argument(
        "--workers", type=int, metavar="N", help="processes on this machine; default: its cores"
    )
    add_out(sweep, None, "results/NAME/")
    add_force(sweep)
    sweep.set_defaults(action=_sweep)


def _sweep(options: argparse.Namespace) -> int:
    study = read_study(options.study)
    folder = folder_of(study, options.out)
    means = Means(
        options.engine,
        options.kind,
        options.loop,
        options.scheduler,
        options.workers,
        options.force,
    )
    try:
        result = swept(study, means, folder, options.command, say, progress=True)
    except KeyboardInterrupt:
        say(f"interrupted; {folder} keeps what is done: the same command goes on from there")
        return INTERRUPTED
    show(f"{study.name}: {result.runs:,} runs, of which {result.failed:,} failed")
    show(f"written to {folder}{os.sep}")
    return OK
