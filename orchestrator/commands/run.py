"""`auv-fmu run` and `animate`."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.analysis.animation import animate, check_format
from orchestrator.analysis.figures import missing_for
from orchestrator.analysis.metrics import LAST_SECONDS
from orchestrator.analysis.visible import VisibleRows
from orchestrator.commands.options import (
    FAILED,
    OK,
    add_experiment,
    add_out,
    add_set,
    add_system,
    assignments,
    say,
)
from orchestrator.errors import InputError
from orchestrator.experiments.experiment import Request, loaded, prepare, with_companion
from orchestrator.experiments.run import Files, run_into
from orchestrator.master.files import FORMATS
from orchestrator.master.observer import Ending
from orchestrator.master.progress import Progress
from orchestrator.master.simulation import simulate


def add_to(commands: Any) -> None:
    """Add these commands to the parser."""
    run = commands.add_parser("run", help="run a scenario, a scenario file or an SSP")
    add_system(run)
    add_experiment(run)
    add_set(run)
    add_out(run, None, "results/SCENARIO/")
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
    run.set_defaults(action=_run)

    film = commands.add_parser("animate", help="write a film of a scenario")
    add_system(film)
    add_experiment(film)
    add_set(film)
    film.add_argument(
        "--out", type=Path, metavar="FILE", help="a .gif or .mp4; default: results/SCENARIO.gif"
    )
    film.set_defaults(action=_animate)


def _request(options: argparse.Namespace) -> Request:
    return Request(options.stop_time, options.step, options.order, assignments(options))


def _run(options: argparse.Namespace) -> int:
    request = _request(options)
    runs = with_companion(prepare(*loaded(options.scenario), request), request)
    folder = options.out or Path("results", runs[0].scenario.name)
    files = Files(options.interval, options.columns, options.format, options.figures)
    finished = run_into(folder, runs, files, options.command, say)
    for run in finished:
        _print_summary(run.metrics)
    print(f"written to {folder}{os.sep}")
    return max(_status(run.name, run.ending) for run in finished)


def _status(name: str, ending: Ending) -> int:
    """Exit status of a run, after saying what went wrong in it."""
    for message in ending.messages:
        say(message)
    if ending.failure is None:
        return OK
    say(f"{name} {ending.failure}")
    return FAILED


def _print_summary(values: Mapping[str, Any]) -> None:
    last = min(LAST_SECONDS, values["stop_time"])
    rows = {
        "l2_effort": "L2 effort u, q, r [N.s^1/2, N.m.s^1/2]",
        "peak_command": "peak command u, q, r [N, N.m]",
        "saturated_fraction": "share of saturated steps u, q, r",
        "total_variation": "total variation u, q, r [N, N.m]",
        "final_error": f"largest error x, y, z in the last {last:g} s [m]",
    }
    print(values["scenario"])
    for key, label in rows.items():
        if key in values:
            print(f"  {label:44}" + "".join(f"{_number(value):>11}" for value in values[key]))


def _number(value: float) -> str:
    """Four digits; an exponent only where zeros would be all that is seen."""
    if value and not 1e-4 <= abs(value) < 1e7:
        return f"{value:.3e}"
    return np.format_float_positional(value, precision=4, unique=False, fractional=False, trim="-")


def _animate(options: argparse.Namespace) -> int:
    scenario, system = loaded(options.scenario)
    path = options.out or Path("results", f"{scenario.name}.gif")
    check_format(path)
    prepared = prepare(scenario, system, _request(options))
    seen = VisibleRows()
    ending = simulate(prepared.system, prepared.experiment, [seen, Progress(scenario.name)])
    if missing := missing_for("open-loop", seen):
        raise InputError(f"{options.scenario}: has no vehicle to show: no {missing[0]}")
    label = f", {scenario.label}" if scenario.label else ""
    animate(f"{scenario.name}{label}", seen, path)
    print(path)
    return _status(scenario.name, ending)
