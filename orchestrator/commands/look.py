"""`auv-fmu animate`: looking at runs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from orchestrator.analysis.animation import animate, check_format
from orchestrator.analysis.figures import missing_for
from orchestrator.analysis.visible import VisibleRows
from orchestrator.commands.options import add_experiment, add_set, add_system, request, status
from orchestrator.errors import InputError
from orchestrator.experiments.experiment import loaded, prepare
from orchestrator.master.progress import Progress
from orchestrator.master.simulation import simulate


def add_to(commands: Any) -> None:
    """Add these commands to the parser."""
    film = commands.add_parser("animate", help="write a film of a scenario")
    add_system(film)
    add_experiment(film)
    add_set(film)
    film.add_argument(
        "--out", type=Path, metavar="FILE", help="a .gif or .mp4; default: results/SCENARIO.gif"
    )
    film.set_defaults(action=_animate)


def _animate(options: argparse.Namespace) -> int:
    scenario, system = loaded(options.scenario)
    path = options.out or Path("results", f"{scenario.name}.gif")
    check_format(path)
    prepared = prepare(scenario, system, request(options))
    seen = VisibleRows()
    ending = simulate(prepared.system, prepared.experiment, [seen, Progress(scenario.name)])
    if missing := missing_for("open-loop", seen):
        raise InputError(f"{options.scenario}: has no vehicle to show: no {missing[0]}")
    label = f", {scenario.label}" if scenario.label else ""
    animate(f"{scenario.name}{label}", seen, path)
    print(path)
    return status(scenario.name, ending)
