"""Commands that make runs: run one, sweep many."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.commands.options import (
    INTERRUPTED,
    OK,
    add_experiment,
    add_force,
    add_kind,
    add_loop,
    add_out,
    add_set,
    add_system,
    read,
    request,
    status,
)
from orchestrator.commands.streams import say, show
from orchestrator.machine.errors import Findings
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.master.experiment import COUPLINGS
from orchestrator.master.fmi.isolated import STEP_TIMEOUT, isolation_of
from orchestrator.master.observers.files import FORMATS
from orchestrator.runs.inputs import inputs_of
from orchestrator.runs.preparation import prepare, with_companion
from orchestrator.runs.run import Files, run_into
from orchestrator.runs.scenario import read_scenario
from orchestrator.studies.study import ENGINES, read_study, ready_studies
from orchestrator.studies.sweep import Means, folder_of, swept
from orchestrator.vehicle.indices import metrics, of_vehicles


def add_to(commands: Any) -> None:
    """Add these commands to the parser."""
    run = commands.add_parser("run", help="run a scenario, a scenario file or an SSP")
    add_system(run)
    add_experiment(run)
    add_set(run)
    add_out(run, None, "results/SCENARIO/")
    add_force(run)
    run.add_argument(
        "--interval",
        type=float,
        metavar="S",
        help="rows kept in the table, one for each interval [s]; default: one a step",
    )
    run.add_argument(
        "--columns",
        default="all",
        metavar="outputs|all|PATTERN,...",
        help="columns kept in the table, for example plant.y.*,controller.tau; default: all",
    )
    run.add_argument(
        "--format", choices=tuple(FORMATS), default="csv", help="of the table; default: csv"
    )
    run.add_argument(
        "--no-figures", dest="figures", action="store_false", help="draw none; default: draw"
    )
    run.add_argument(
        "--isolate",
        action="store_true",
        help="run each FMU in a process of its own, where it can crash or hang",
    )
    run.add_argument(
        "--step-timeout",
        type=float,
        metavar="S",
        help="how long an isolated FMU may take for one call [s]; "
        f"default: {STEP_TIMEOUT:g}; needs --isolate",
    )
    run.add_argument(
        "--checkpoint-every",
        type=float,
        metavar="S",
        help="keep what it takes to go on, every so many simulated seconds, in DIR/checkpoint",
    )
    run.add_argument(
        "--resume", action="store_true", help="go on from the last checkpoint in DIR/checkpoint"
    )
    run.add_argument(
        "--real-time",
        type=float,
        metavar="FACTOR",
        help="go no faster than FACTOR simulated seconds in a second",
    )
    run.add_argument(
        "--coupling",
        choices=COUPLINGS,
        help="how rings of direct feedthroughs are closed: solved, delayed by a step, or solved "
        "with inputs that change linearly during a step; default: the scenario's, else solved "
        "where the FMUs allow it",
    )
    add_loop(run)
    run.add_argument(
        "--events",
        metavar="SCENARIO|FILE.toml",
        help="what happens during the run: the events of another scenario, for this one or an SSP",
    )
    run.add_argument(
        "--inputs",
        type=Path,
        metavar="FILE",
        help="a table in CSV or Parquet of inputs that nothing feeds, over time",
    )
    run.set_defaults(action=_run)
    _add_sweep(commands)


def _run(options: argparse.Namespace) -> int:
    isolation = isolation_of(options.isolate, options.step_timeout)
    wanted = replace(
        request(options),
        isolation=isolation,
        loop=options.loop,
        real_time=options.real_time,
        events=None if options.events is None else read_scenario(options.events).events,
        inputs=inputs_of(options.inputs),
        coupling=options.coupling,
    )
    runs = with_companion(prepare(*read(options), wanted), wanted)
    findings = Findings(options.strict)
    for prepared in runs:
        for doubt in prepared.doubts():
            findings.note(f"{prepared.scenario.name}: {doubt}")
    findings.refuse()
    for note in findings.notes:
        say(f"warning: {note}")
    folder = options.out or Path("results", runs[0].scenario.stem)
    files = Files(
        options.interval,
        options.columns,
        options.format,
        options.figures,
        options.checkpoint_every,
        options.resume,
        options.force,
    )
    # Until all is written: a user who stops a run several times wants to know where its rows are.
    with held_interrupts(_answer, is_last=True):
        finished = run_into(folder, runs, files, options.command, say)
        for run in finished:
            _print_summary(run.metrics)
            for note in run.notes:
                show(f"  {note}")
        show(f"written to {finished[0].folder}{os.sep}")
        if finished[0].folder != folder:
            say(f"{folder} keeps the whole result that was there before")
    return max(status(run.name, run.ending) for run in finished)


def _answer(interrupts: Interrupts) -> None:
    """Tell the user at once what happens now, from within the handler of the signal."""
    text = "stopping: writing what was computed and drawing it; once more leaves the figures out"
    if interrupts.urgent:
        text = "stopping at once, without figures; a third time ends an FMU that does not return"
    # print could have been interrupted itself, and must not be entered a second time.
    with suppress(OSError):
        os.write(2, f"auv-fmu: {text}\n".encode())


def _print_summary(values: Mapping[str, Any]) -> None:
    for vehicle, found in of_vehicles(values).items():
        measured = [index for index in metrics() if index.name in found]
        if measured:
            show(", ".join(filter(None, (values["scenario"], vehicle))))
        for index in measured:
            title = f"{index.label} {index.members}" + f" [{index.unit}]" * bool(index.unit)
            numbers = np.atleast_1d(found[index.name]).tolist()
            show(f"  {title:44}" + "".join(f"{_number(number):>11}" for number in numbers))


def _number(value: float) -> str:
    """Four digits; an exponent only where zeros would be all that is seen."""
    if value and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.3e}"
    return np.format_float_positional(value, precision=4, unique=False, fractional=False, trim="-")


def _add_sweep(commands: Any) -> None:
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
