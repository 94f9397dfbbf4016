"""`auv-fmu run`, in a module without studies, whose import takes a fifth of a second."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from contextlib import suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from orchestrator.commands.options import (
    add_options,
    add_out,
    add_set,
    add_system,
    from_options,
    read_system,
    request,
    status,
)
from orchestrator.commands.streams import describe, say, show
from orchestrator.machine.errors import Findings
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.runs.preparation import prepare, with_companion
from orchestrator.runs.request import Files, Request
from orchestrator.runs.result import summary
from orchestrator.runs.run import run_into


def add_run(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `auv-fmu run`."""
    describe(
        parser,
        "Run a scenario, a scenario file, an SSP or an FMU, and write its table, metrics and the "
        "figures of its vehicles. FMUs that are missing are built first.",
        "run fig4 --stop-time 20 --set plant.noise.std=0",
    )
    add_system(parser)
    add_options(parser, Request)
    add_set(parser)
    add_out(parser, "results/SCENARIO/")
    add_options(parser, Files)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    run_request = request(options)
    runs = with_companion(prepare(*read_system(options), run_request), run_request)
    files, findings = from_options(Files, options), Findings(options.strict)
    for prepared in runs:
        for doubt in prepared.doubts():
            findings.note(f"{prepared.scenario.name}: {doubt}")
    step = runs[0].experiment.step
    if files.interval is not None and files.interval < step:
        findings.note(
            f"--interval {files.interval:g}: shorter than the step of {step:g} s: the table has "
            "one row per step"
        )
    findings.refuse()
    for note in findings.notes:
        say(f"warning: {note}")
    folder = options.out or Path("results", runs[0].scenario.stem)
    draw = None
    # All figures show a vehicle.
    vehicles = {loop.vehicle for loop in runs[0].loops} & runs[0].system.components.keys()
    if vehicles and not files.no_figures:
        # The import takes long: now, there are no rows to lose.
        from orchestrator.figures.drawing import draw as draw_figures  # noqa: PLC0415

        draw = draw_figures
    # To the end, so that several interrupts do not hide where the rows are.
    with held_interrupts(_answer, is_last=True):
        place, finished = run_into(folder, runs, files, options.command, say, draw)
        for run in finished:
            _print_summary(run.metrics)
            for note in run.notes:
                show(f"  {note}")
        show(f"written to {place}{os.sep}")
        if place != folder:
            say(f"{folder} still holds the earlier, complete result")
    return max(status(run.name, run.ending) for run in finished)


def _answer(interrupts: Interrupts) -> None:
    """Answer an interrupt within the handler of its signal."""
    text = "stopping: writing and drawing the computed rows; interrupt again to skip the figures"
    if interrupts.urgent:
        text = (
            "stopping at once, without figures; a third interrupt ends an FMU that does not return"
        )
    # The signal may have interrupted print, which is not reentrant.
    with suppress(OSError):
        os.write(2, f"auv-fmu: {text}\n".encode())


def _print_summary(values: Mapping[str, Any]) -> None:
    for vehicle, lines in groupby(summary(values), key=itemgetter(0)):
        show(", ".join(filter(None, (values["scenario"], vehicle))))
        for _, title, numbers in lines:
            show(f"  {title:44}" + "".join(f"{number:>11}" for number in numbers))
