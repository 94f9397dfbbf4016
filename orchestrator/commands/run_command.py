"""`auv-fmu run`, in a module without studies, whose import takes a fifth of a second."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from itertools import groupby
from math import ceil, floor
from operator import itemgetter
from pathlib import Path

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
from orchestrator.figures.style import printed_unit
from orchestrator.machine.errors import Findings, InputError, escape_unprintable, shortened
from orchestrator.machine.identity import digest_of
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.machine.lazy import passing_line
from orchestrator.runs.preparation import Prepared, prepare, with_companion
from orchestrator.runs.request import Files, Request
from orchestrator.runs.result import format_number, read_record, summary, table_in
from orchestrator.runs.run import WrittenRun, first_figure, run_into

#: Relative difference of a multiple of the step that counts as none.
_SAME = 1e-9

#: Letters of a name with its changes, and lines of a table of outputs.
_LONGEST, _MOST_OUTPUTS = 100, 24


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
    files, findings = from_options(Files, options), Findings(options.strict)
    draw = None
    with passing_line(f"reading {escape_unprintable(options.scenario)} ..."):
        runs = with_companion(prepare(*read_system(options), run_request), run_request)
        for prepared in runs:
            for doubt in prepared.doubts():
                findings.note(f"{prepared.scenario.name}: {doubt}")
        if files.interval is not None:
            note_interval(files.interval, runs[0].experiment.step, findings)
        findings.refuse()
        for note in findings.notes:
            say(f"warning: {note}")
        if not files.no_figures:
            # The import takes long: now, there are no rows to lose.
            from orchestrator.figures.drawing import draw as draw_figures  # noqa: PLC0415

            draw = draw_figures
    folder = options.out or Path("results", runs[0].scenario.stem)
    earlier = _replaced(folder, runs[0])
    # To the end, so that several interrupts do not hide where the rows are.
    with held_interrupts(_answer, is_last=True):
        place, finished = run_into(folder, runs, files, options.command, say, draw)
        for run in finished:
            name = run.name
            if run is finished[0]:
                name = shortened(replace(run_request, scenario=name).label, _LONGEST)
            _print_numbers(run, name)
            for note in run.notes:
                show(f"  {note}")
        show(*(f"{run.name}: {run.verdict}" for run in finished if run.verdict))
        show(f"written to {place}{os.sep}{earlier if place == folder else ''}")
        if (figure := first_figure(place, runs[0])) is not None:
            show(f"figure: {figure}")
        if place != folder:
            say(f"{folder} still holds the earlier, complete result")
    return max(status(run.name, run.ending) for run in finished)


def note_interval(interval: float, step: float, findings: Findings) -> None:
    """Note that rows are not as far apart as an interval asks [s]."""
    if interval < step:
        findings.note(
            f"--interval {interval:g}: shorter than the step of {step:g} s: the table has one row "
            "per step"
        )
        return
    steps = interval / step
    if abs(steps - round(steps)) > _SAME * steps:
        fewer, more = (number(steps) * step for number in (floor, ceil))
        findings.note(
            f"--interval {interval:g}: not a multiple of the step of {step:g} s: rows are unevenly "
            f"spaced; use {fewer:g} or {more:g}"
        )


def _replaced(folder: Path, prepared: Prepared) -> str:
    """Return words on an earlier result in a folder that is of another run; else none."""
    with suppress(InputError, LookupError, ValueError):
        record = read_record(table_in(folder))
        if record["identity"] != digest_of(prepared.identity):
            started = datetime.fromisoformat(record["started"]).astimezone()
            is_today = started.date() == datetime.now().astimezone().date()
            return f", in place of the run of {started:{'%H:%M' if is_today else '%Y-%m-%d'}}"
    return ""


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


def _print_numbers(run: WrittenRun, name: str) -> None:
    """Print the indices of a run, or, without a vehicle, the first and last values of outputs."""
    if run.ending.failure is not None and "stop_time" in run.metrics:
        name += f", only the first {run.metrics['stop_time']:g} s"
    if not run.prepared.vehicles:
        _print_outputs(name, run)
        return
    for vehicle, lines in groupby(summary(run.metrics), key=itemgetter(0)):
        show(", ".join(filter(None, (name, vehicle))))
        for _, title, numbers in lines:
            _print_line(title, numbers)


def _print_outputs(name: str, run: WrittenRun) -> None:
    rows = run.seen
    known = [output for output in run.outputs if output in rows]
    if not known or not len(rows):
        return
    show(name)
    _print_line("", ["first", "last"])
    for output in known[:_MOST_OUTPUTS]:
        unit = printed_unit(rows.units.get(output, ""))
        title = f"{output} [{unit}]" if unit else output
        # The sum is zero instead of minus zero.
        _print_line(title, [format_number(float(rows[output][i]) + 0.0) for i in (0, -1)])
    more = len(known) - _MOST_OUTPUTS
    if more > 0:
        show(f"  and {more} more outputs")


def _print_line(title: str, numbers: Sequence[str]) -> None:
    show(f"  {title:44}" + "".join(f"{number:>11}" for number in numbers))
